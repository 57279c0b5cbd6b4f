"""Stage 1: base velocity and centres of pressure (Faraji et al., 2015, eq. 5 to 8).

Everything in the axes of the base B, but the centre of pressure x_i, which is in its contact's frame C_i. The point of
foot i at x_i has no velocity, up to delta_i:

    ydot + D_i + C_i x_i = delta_i
    C_i = S(omega_i) R_i,   D_i = v_i + omega_b x p_i,   omega_i = omega_b + omega_BC,i

where S(a) b = a x b. With omega_c, the foot's rate against the base in C's axes, S(omega_i) R_i is the paper's
R_i S(omega_c) + S(omega_b) R_i. No moment acts about a centre of pressure but along the normal: with E = [f; t] the
external wrench at C and x = (x, y, 0), the moment about x is t - x × f, whose first two components are t_x - y f_z and
t_y + x f_z, so

    x_cop = (-t_y, t_x)/f_z,   |m_cop|^2 = f_z^2 |x - x_cop|^2

which makes the paper's program

    min  sum_i w_i/s_d^2 |ydot + D_i + C_i x_i|^2 + f_i^2/s_m^2 |x_i - x_cop,i|^2 + c |ydot - ydot_ref|^2
    s.t. N_i x_i <= d_i

Without active limits it has a closed form: x_i is eliminated, L_i = w_i (s_d^2 I + w_i s_m^2/f_i^2 C_i C_i^T)^-1 are
the information matrices of the contacts, and ydot solves three equations. Only where a centre of pressure so found
leaves its sole is the program solved.

The velocity update of a tick: base velocity and centres of pressure from what the contacts carry.
"""

from typing import NamedTuple

import numpy as np

from drake_tc.kernels.base.contacts import LEAST_LOAD, Slip, Stance, slipping
from drake_tc.kernels.base.sample import FLAT, HALF_PLANES, MIDDLE, Given, Sample
from drake_tc.kernels.base.state import DROPPED, LIMITED, STARTED, Memory
from drake_tc.kernels.compiling import helper
from drake_tc.kernels.linear_algebra import cross, times, times_transposed
from drake_tc.types import GRAVITY, BoolArray, FloatArray

FREE, AT_EDGE, UNSOLVED = range(3)
"""How a velocity was found: in closed form; by the program; not yet, for the program has still to be solved."""
_SOLVED, _FAILED = 1.0, -1.0
"""First entry of a program's solution."""


class VelocityProblem(NamedTuple):
    """One tick; k contacts, some of them without weight.

    Attributes:
        reference: (3,) ydot_ref [m/s]. trust: c of the cost, 1/(m/s)^2.
        matrix: (k, 3, 2) C_i [1/s]. still: (k, 3) D_i + C_i x_cop,i [m/s].
        pressure: (k, 2) x_cop [m]. spread: (k,) s_m/f_i [m]; 0 for points.
        weight: (k,) w_i; 0 switches a contact off.
        deviation: s_d [m/s].
    """

    reference: FloatArray
    trust: float
    matrix: FloatArray
    still: FloatArray
    pressure: FloatArray
    spread: FloatArray
    weight: FloatArray
    deviation: float


class Velocity(NamedTuple):
    """The answer.

    Attributes:
        how: FREE, AT_EDGE or UNSOLVED.
        velocity: (3,) ydot [m/s]. pressure: (k, 2) x [m]. limited: (k,) which soles end where x is.
    """

    how: int
    velocity: FloatArray
    pressure: FloatArray
    limited: BoolArray


@helper
def closed_form(problem: VelocityProblem) -> tuple[FloatArray, FloatArray]:
    """(ydot (3,) [m/s], x (k, 2) [m]) where no sole ends; contacts without weight keep what they came with."""
    d2, c, k = problem.deviation**2, problem.trust, problem.weight.size
    xx = yy = zz = c
    xy = xz = yz = 0.0
    gx, gy, gz = c * problem.reference[0], c * problem.reference[1], c * problem.reference[2]
    gains = np.zeros((k, 2, 3))
    for i in range(k):
        w, spread, e = problem.weight[i], problem.spread[i], problem.still[i]
        if not w > 0.0:
            continue
        C = problem.matrix[i]
        ax, ay, az, bx, by, bz = C[0, 0], C[1, 0], C[2, 0], C[0, 1], C[1, 1], C[2, 1]
        # w (d2 I + v C C^T)^-1 = u (I - C K C^T) with K = v (d2 I + v C^T C)^-1, of two rows
        v, u = w * spread * spread, w / d2
        p, r = d2 + v * (ax * ax + ay * ay + az * az), d2 + v * (bx * bx + by * by + bz * bz)
        q = v * (ax * bx + ay * by + az * bz)
        scale = v / (p * r - q * q)
        kaa, kab, kbb = scale * r, -scale * q, scale * p
        mx, my, mz = kaa * ax + kab * bx, kaa * ay + kab * by, kaa * az + kab * bz
        nx, ny, nz = kab * ax + kbb * bx, kab * ay + kbb * by, kab * az + kbb * bz
        lxx, lyy, lzz = 1.0 - ax * mx - bx * nx, 1.0 - ay * my - by * ny, 1.0 - az * mz - bz * nz
        lxy, lxz, lyz = -ax * my - bx * ny, -ax * mz - bx * nz, -ay * mz - by * nz
        xx, yy, zz = xx + u * lxx, yy + u * lyy, zz + u * lzz
        xy, xz, yz = xy + u * lxy, xz + u * lxz, yz + u * lyz
        gx -= u * (lxx * e[0] + lxy * e[1] + lxz * e[2])
        gy -= u * (lxy * e[0] + lyy * e[1] + lyz * e[2])
        gz -= u * (lxz * e[0] + lyz * e[1] + lzz * e[2])
        gain = gains[i]
        gain[0, 0], gain[0, 1], gain[0, 2] = mx, my, mz
        gain[1, 0], gain[1, 1], gain[1, 2] = nx, ny, nz
    cxx, cxy, cxz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    det = xx * cxx + xy * cxy + xz * cxz
    y = np.empty(3)
    y[0] = (cxx * gx + cxy * gy + cxz * gz) / det
    y[1] = (cxy * gx + (xx * zz - xz * xz) * gy + (xy * xz - xx * yz) * gz) / det
    y[2] = (cxz * gx + (xy * xz - xx * yz) * gy + (xx * yy - xy * xy) * gz) / det
    x = problem.pressure.copy()
    for i in range(k):  # x - x_cop = -K C^T (ydot + e), no gain without weight
        for j in range(3):
            x[i, 0] -= gains[i, 0, j] * (y[j] + problem.still[i, j])
            x[i, 1] -= gains[i, 1, j] * (y[j] + problem.still[i, j])
    return y, x


@helper
def is_outside(x: FloatArray, sole: FloatArray) -> bool:
    """Whether a point (2,) lies beyond a half plane of its sole."""
    outside = False
    for at in range(HALF_PLANES, sole.size, 3):
        outside = outside or sole[at] * x[0] + sole[at + 1] * x[1] - sole[at + 2] > 0.0
    return outside


@helper
def into_sole(x: FloatArray, sole: FloatArray) -> None:
    """Draw a point (2,) outside its sole towards the sole's middle until it is inside."""
    if not sole[FLAT]:
        return
    share, found = 1.0, False
    for at in range(HALF_PLANES, sole.size, 3):
        a, b = sole[at], sole[at + 1]
        rate = a * (x[0] - sole[MIDDLE]) + b * (x[1] - sole[MIDDLE + 1])
        room = sole[at + 2] - (a * sole[MIDDLE] + b * sole[MIDDLE + 1])
        if rate > room:
            share = min(share, room / rate) if found else room / rate
            found = True
    share = max(0.0, share)
    for i in range(2):
        x[i] = sole[MIDDLE + i] + share * (x[i] - sole[MIDDLE + i])


@helper
def program_found(problem: VelocityProblem, solution: FloatArray) -> Velocity:
    """The program's solution, where there is one; arguments as in `solve_velocity`."""
    k = problem.weight.size
    limited = np.zeros(k, dtype=np.bool_)
    if solution[0] != _SOLVED:
        return Velocity(UNSOLVED, problem.reference, problem.pressure, limited)
    velocity, pressure = solution[1:4].copy(), solution[4 : 4 + 2 * k].copy().reshape(k, 2)
    for i in range(k):
        limited[i] = solution[4 + 2 * k + i] > 0.0
    return Velocity(AT_EDGE, velocity, pressure, limited)


@helper
def solve_velocity(problem: VelocityProblem, soles: FloatArray, at_edge: bool, solution: FloatArray) -> Velocity:
    """Base velocity and centres of pressure.

    Args:
        problem: The tick's.
        soles: (k, w) rows of the contacts.
        at_edge: Whether an edge is likely active, as in the last tick: the program is then solved at once.
        solution: (4 + 3k,) of the program: 0 where it has not been solved yet, 1 or, where it could not be solved, -1;
            then ydot, x, and 1 for each sole that ends where x is.
    """
    k = problem.weight.size
    limited = np.zeros(k, dtype=np.bool_)
    if at_edge and solution[0] != _FAILED:
        return program_found(problem, solution)
    velocity, pressure = closed_form(problem)
    outside = counts = False
    for i in range(k):
        limited[i] = is_outside(pressure[i], soles[i])
        outside = outside or limited[i]
        counts = counts or (limited[i] and problem.weight[i] > 0.0)
    if not outside:
        return Velocity(FREE, velocity, pressure, limited)
    if counts and solution[0] != _FAILED:
        return program_found(problem, solution)
    for i in range(k):
        if limited[i]:
            into_sole(pressure[i], soles[i])
        limited[i] = limited[i] and counts
    return Velocity(FREE, velocity, pressure, limited)


_FIRST = 1e-3
"""Share of `velocity_time` that the rest before the first tick is trusted."""


class Motion(NamedTuple):
    """What stage 1 finds.

    Attributes:
        found: Velocity and centres of pressure. reference: (3,) what the accelerometer carried on [m/s].
        slip: What was dropped. weight: (k,) loads of the contacts that count [N].
    """

    found: Velocity
    reference: FloatArray
    slip: Slip
    weight: FloatArray


@helper
def predicted_velocity(before: Memory, sample: Sample, stance: Stance, dt: float) -> FloatArray:
    """(3,) ydot_ref: the last velocity, and what the accelerometer adds to it [m/s]; arguments as in `find_motion`."""
    pose = stance.pose
    if not before.scalars[STARTED] or not (sample.has_accel or stance.loads.on.any()):
        return np.zeros(3)  # nothing says how the base moves: it is held
    moved = times(before.rotation, before.velocity + before.lever)
    reference: FloatArray = times_transposed(pose.predicted, moved) - stance.sunk.posture.velocity[-1]
    if sample.has_accel:
        reference += dt * (pose.accel - GRAVITY * pose.up)
    return reference


@helper
def find_motion(given: Given, sample: Sample, stance: Stance, solution: FloatArray) -> tuple[Motion, VelocityProblem]:
    """Base velocity and centres of pressure; and the program that says what they are.

    Args:
        given: Beside the sample.
        sample: Readings after validation.
        stance: How the robot stands.
        solution: Of the program, see `solve_velocity`.
    """
    soles, before, options = given.soles, given.before, given.options
    loads, posture = stance.loads, stance.sunk.posture
    k, dt, first = soles.shape[0], options.period, not before.scalars[STARTED]
    reference = predicted_velocity(before, sample, stance, dt)
    matrix, still, against = np.empty((k, 3, 2)), np.empty((k, 3)), np.empty((k, 3))
    spread, new, at_edge = np.empty(k), loads.new.copy(), False
    for i in range(k):
        still[i] = posture.velocity[i]
        for axis in range(2):
            column = cross(posture.rate[i], posture.rotation[i, :, axis])
            for a in range(3):
                matrix[i, a, axis] = column[a]
                still[i, a] += column[a] * loads.pressure[i, axis]
        against[i] = -still[i] - reference
        spread[i] = soles[i, FLAT] * options.cop_moment / max(loads.wrench[i, 2], LEAST_LOAD)
        new[i] = new[i] or first
        at_edge = at_edge or before.contact_flags[i, LIMITED] > 0.0
    last = Slip(before.drift, before.contacts[:, DROPPED].copy())
    slip = slipping((loads.on, new, loads.load), against, last, options)
    weight = np.zeros(k)
    for i in range(k):
        if loads.on[i] and not slip.dropped[i]:
            weight[i] = max(loads.load[i], LEAST_LOAD)
    total = weight.sum()
    trust = (_FIRST if first else 1.0) * options.velocity_time / dt / options.contact_velocity**2
    share = weight / (total if total > 0.0 else 1.0)
    problem = VelocityProblem(reference, trust, matrix, still, loads.pressure, spread, share, options.contact_velocity)
    return Motion(solve_velocity(problem, soles, at_edge, solution), reference, slip, weight), problem


@helper
def write_program(out: FloatArray, problem: VelocityProblem) -> None:
    """[ydot_ref, c, s_d, C_i, D_i + C_i x_cop, x_cop, s_m/f_i, w_i] into (5 + 13k,)."""
    k = problem.weight.size
    out[:3], out[3], out[4] = problem.reference, problem.trust, problem.deviation
    out[5 : 5 + 6 * k], out[5 + 6 * k : 5 + 9 * k] = problem.matrix.ravel(), problem.still.ravel()
    out[5 + 9 * k : 5 + 11 * k] = problem.pressure.ravel()
    out[5 + 11 * k : 5 + 12 * k], out[5 + 12 * k :] = problem.spread, problem.weight
