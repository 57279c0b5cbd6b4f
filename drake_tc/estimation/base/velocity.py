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
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from daqp import solve  # type: ignore[import-not-found, import-untyped, unused-ignore]

from drake_tc.estimation.base.spec import ContactSpec, half_planes
from drake_tc.types import FloatArray

_NO_LIMIT = 1e30


@dataclass(frozen=True, eq=False)
class Soles:
    """The soles of k contacts as half planes N x <= d, padded to the same number m of rows.

    Attributes:
        normals: (k, m, 2); zero rows pad, and all rows of a point are padding: it has no room to leave.
        offsets: (k, m) [m]; `_NO_LIMIT` where padded.
        middle: (k, 2) mean of the corners [m]; zero of a point.
        flat: (k,) 1 for a sole, 0 for a point.
        rows, nothing, sense: (k m, 3 + 2k), (k m,), (k m,) the half planes as the solver takes them.
        template: (k, 3, 3 + 2k) [I 0 ... 0].
    """

    normals: FloatArray
    offsets: FloatArray
    middle: FloatArray
    flat: FloatArray
    rows: FloatArray
    nothing: FloatArray
    sense: Any
    template: FloatArray


def soles_of(contacts: tuple[ContactSpec, ...]) -> Soles:
    """The soles of the contacts.

    Raises:
        ParamsError: a polygon that is not convex.
    """
    k, m = len(contacts), max((len(c.polygon) for c in contacts if c.polygon is not None), default=1)
    normals, offsets = np.zeros((k, m, 2)), np.full((k, m), _NO_LIMIT)
    middle, flat = np.zeros((k, 2)), np.zeros(k)
    for i, contact in enumerate(contacts):
        if contact.polygon is not None:
            rows, limits = half_planes(f"contact {contact.mount.name!r}", contact.polygon)
            normals[i, : len(rows)], offsets[i, : len(rows)] = rows, limits
            middle[i], flat[i] = np.mean(contact.polygon, axis=0), 1.0
    whole = np.zeros((k * m, 3 + 2 * k))
    for i in range(k):
        whole[i * m : (i + 1) * m, 3 + 2 * i : 5 + 2 * i] = normals[i]
    template = np.zeros((k, 3, 3 + 2 * k))
    template[:, :, :3] = np.eye(3)
    below = np.full(k * m, -_NO_LIMIT)
    return Soles(normals, offsets, middle, flat, whole, below, np.zeros(k * m, dtype=np.int32), template)


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


def solve_velocity(
    problem: VelocityProblem, soles: Soles, *, at_edge: bool = False
) -> tuple[FloatArray, FloatArray, list[bool]]:
    """(ydot (3,) [m/s], x (k, 2) [m], which of the k soles end where x is).

    Contacts without weight keep the centre of pressure that they came with, drawn into the sole. Written out in
    numbers: on 3-vectors a call into numpy costs more than the arithmetic.

    Args:
        problem: The tick's.
        soles: Limits of the centres of pressure.
        at_edge: Whether an edge is likely active, as in the last tick: the program is then solved at once.
    """
    if at_edge:
        solution = _program(problem, soles)
        if solution is not None:
            return solution
    d2, c = problem.deviation**2, problem.trust
    rx, ry, rz = problem.reference.tolist()
    xx = yy = zz = c
    xy = xz = yz = 0.0
    gx, gy, gz = c * rx, c * ry, c * rz
    rows = list(
        zip(
            problem.matrix.tolist(),
            problem.still.tolist(),
            problem.weight.tolist(),
            problem.spread.tolist(),
            strict=True,
        )
    )
    parts: list[tuple[float, ...] | None] = []
    for ((ax, bx), (ay, by), (az, bz)), (ex, ey, ez), w, spread in rows:
        if not w > 0.0:
            parts.append(None)
            continue
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
        gx -= u * (lxx * ex + lxy * ey + lxz * ez)
        gy -= u * (lxy * ex + lyy * ey + lyz * ez)
        gz -= u * (lxz * ex + lyz * ey + lzz * ez)
        parts.append((mx, my, mz, nx, ny, nz))
    cxx, cxy, cxz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    det = xx * cxx + xy * cxy + xz * cxz
    vx = (cxx * gx + cxy * gy + cxz * gz) / det
    vy = (cxy * gx + (xx * zz - xz * xz) * gy + (xy * xz - xx * yz) * gz) / det
    vz = (cxz * gx + (xy * xz - xx * yz) * gy + (xx * yy - xy * xy) * gz) / det
    velocity = np.array([vx, vy, vz])
    moved = problem.pressure.tolist()
    for place, part, (_, (ex, ey, ez), *_) in zip(moved, parts, rows, strict=True):
        if part is not None:  # x - x_cop = -K C^T (ydot + e)
            mx, my, mz, nx, ny, nz = part
            ex, ey, ez = ex + vx, ey + vy, ez + vz
            place[0] -= mx * ex + my * ey + mz * ez
            place[1] -= nx * ex + ny * ey + nz * ez
    x = np.array(moved)
    beyond = (soles.normals @ x[:, :, None])[:, :, 0] - soles.offsets
    if not beyond.max() > 0.0:
        return velocity, x, [False] * len(rows)
    outside = beyond.max(axis=1) > 0.0
    if not (outside & (problem.weight > 0.0)).any():
        return velocity, into_soles(x, soles), [False] * len(rows)
    return _program(problem, soles) or (velocity, into_soles(x, soles), outside.tolist())


def into_soles(x: FloatArray, soles: Soles) -> FloatArray:
    """(k, 2) x with every point outside its sole drawn towards the sole's middle until it is inside."""
    out = np.array(x)
    for i in np.flatnonzero(soles.flat):
        rate = soles.normals[i] @ (x[i] - soles.middle[i])
        room = soles.offsets[i] - soles.normals[i] @ soles.middle[i]
        share = min((float(b / a) for a, b in zip(rate, room, strict=True) if a > b), default=1.0)
        out[i] = soles.middle[i] + max(0.0, share) * (x[i] - soles.middle[i])
    return out


def _program(problem: VelocityProblem, soles: Soles) -> tuple[FloatArray, FloatArray, list[bool]] | None:
    """The quadratic program over [ydot; x_1; ...]; None where the solver gives none. Points keep x_cop."""
    k = len(problem.weight)
    n = 3 + 2 * k
    A = soles.template.copy()
    curvature = [problem.trust] * n
    for i, spread in enumerate(problem.spread.tolist()):
        if spread > 0.0:
            A[i, :, 3 + 2 * i : 5 + 2 * i] = problem.matrix[i]
            curvature[3 + 2 * i] = curvature[4 + 2 * i] = 1.0 / (spread * spread)
    # about [ydot_ref; x_cop]: z = goal + dz, so that numbers are small
    scale = np.sqrt(problem.weight)[:, None] / problem.deviation
    A *= scale[:, :, None]
    A = A.reshape(3 * k, n)
    b = (scale * (problem.reference + problem.still)).ravel()
    hessian = A.T @ A
    hessian.flat[:: n + 1] += curvature
    room = soles.offsets - (soles.normals @ problem.pressure[:, :, None])[:, :, 0]
    dz, _, flag, told = solve(hessian, A.T @ b, soles.rows, room.ravel(), soles.nothing, soles.sense, primal_tol=1e-9)
    if flag <= 0 or not dz @ dz < np.inf:
        return None
    return (
        problem.reference + dz[:3],
        problem.pressure + dz[3:].reshape(k, 2),
        told["lam"].reshape(k, -1).any(axis=1).tolist(),
    )
