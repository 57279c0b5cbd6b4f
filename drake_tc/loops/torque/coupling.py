"""What the joints of a robot move together, and the margins of each joint's loop while the others' loops are closed.

With the matrices M (inertia of the links) and G (stiffness of their weight) between the joints, and P, C the plant and
the feedback of the single joints (`JointLoop`) on the diagonal,

    P_ij = M_ij (1 - 2/z + 1/z^2)/h^2 + G_ij/z,   C_ij = K_tau' (Kp + Ki h/(z - 1)) (f_ij - M_ij ahat - G_ij qhat)
    S = (1 - C P^-1 z^-1 K_tau^-1)^-1,   L_i = 1/S_ii - 1

where f_ij is what an F/T sensor tells of joint j's motion. The loop is stable where det(P - z^-1 K_tau^-1 C) has all of
its zeros within the unit circle.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.control.joint_loop import JointLoop, grid_margins, quick_margins
from drake_tc.control.stability_margins import ComplexArray, Margins, frequency_grid
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot
from drake_tc.types import GRAVITY, FloatArray

STEP = 1e-5
"""Of the differences of the weight [rad or m]."""
NOTHING = 1e-8
"""A stiffness below this share of the robot's weight, at an arm of 1 m, is a rounding error."""
SLOWEST, POINTS = 0.5, 600
"""Grid of frequencies: where it begins [rad/s], and how many."""


@dataclass(frozen=True, eq=False)
class Coupling:
    """What joints move, without rotors.

    Attributes:
        inertia, gravity: (n, n) M [kg m^2] and G [N m/rad] at a posture, what follows a joint by `<mimic>` included.
        sensed_inertia, sensed_gravity: (n, n) the shares beyond the F/T sensors.
    """

    inertia: FloatArray
    gravity: FloatArray
    sensed_inertia: FloatArray
    sensed_gravity: FloatArray


def coupling(robot: Robot, at: FloatArray) -> Coupling:
    """Between the joints of a robot whose base is at rest.

    Args:
        robot: From `load_robot`.
        at: (n,) positions of its joints [rad or m].

    Raises:
        ParamsError: the URDF cannot be read.
    """
    plant: Any = make_plant(robot, 0.0, followers="free")
    moves, positions = (
        np.zeros((plant.num_velocities(), len(robot.joints))),
        plant.GetPositions(plant.CreateDefaultContext()),
    )
    spread = np.zeros((plant.num_positions(), len(robot.joints)))
    start = np.array(positions)
    rows = [(name, i, 1.0, 0.0) for i, name in enumerate(robot.joints)]
    rows += [(name, robot.joints.index(law.of), law.multiplier, law.offset) for name, law in robot.followers.items()]
    for name, i, factor, offset in rows:
        joint = plant.GetJointByName(name)
        moves[joint.velocity_start(), i] = spread[joint.position_start(), i] = factor
        start[joint.position_start()] = factor * at[i] + offset
    sensed = [body for mount in robot.force_torque for body in _beyond(plant, mount.joint)]
    everything = plant.GetBodyIndices(plant.GetModelInstanceByName(robot.name))
    unsensed = [index for index in everything if index not in sensed]
    whole, beyond = (_matrices(plant, start, spread, moves, massless) for massless in ([], unsensed))
    return Coupling(*whole, *beyond)


def _beyond(plant: MultibodyPlant, weld: str) -> list[Any]:
    """Bodies at and beyond a welded sensor joint that move with its child."""
    child = plant.GetJointByName(weld).child_body()
    found = [child.index()]
    for index in plant.GetJointIndices():
        joint: Any = plant.get_joint(index)
        if joint.parent_body().index() in found:
            found.append(joint.child_body().index())
    return found


def _matrices(
    plant: Any, start: FloatArray, spread: FloatArray, moves: FloatArray, massless: list[Any]
) -> tuple[FloatArray, FloatArray]:
    """(M, G) of the bodies, some of which count as massless."""
    context = plant.CreateDefaultContext()
    for index in massless:
        plant.get_body(index).SetMass(context, 0.0)

    def weights(positions: FloatArray) -> FloatArray:
        """(n,) slope of the potential energy."""
        plant.SetPositions(context, positions)
        return np.asarray(-plant.CalcGravityGeneralizedForces(context) @ moves)

    sides = [[weights(start + way * STEP * each) for each in spread.T] for way in (1.0, -1.0)]
    gravity = (np.array(sides[0]) - np.array(sides[1])).T / (2.0 * STEP)
    plant.SetPositions(context, start)
    gravity[np.abs(gravity) <= NOTHING * GRAVITY * plant.CalcTotalMass(context)] = 0.0
    return moves.T @ plant.CalcMassMatrix(context) @ moves, gravity


def coupled_margins(loops: Sequence[JointLoop], moved: Coupling, known: Coupling) -> list[Margins] | None:
    """Margins of every joint's loop, cut at its drive's effort while the others are closed; None where it is unstable.

    Args:
        loops: One a joint, of one window and period. With force feedback (`kf`), the joints are judged singly.
        moved: What they move.
        known: What the controller takes it for.
    """
    if any(loop.kf for loop in loops):
        single = [quick_margins(loop) for loop in loops]
        return None if None in single else [each for each in single if each is not None]
    dt = loops[0].dt
    omega = frequency_grid(dt, SLOWEST, POINTS)
    plant, feedback, integrator = _responses(loops, moved, known, np.exp(-1j * omega * dt))
    drive = np.exp(-1j * omega * dt)[:, None] / np.array([loop.k_tau for loop in loops])
    closed = integrator[:, :, None] * plant - drive[:, :, None] * feedback
    turn = np.unwrap(np.angle(np.linalg.det(closed)))
    if abs(turn[-1] - turn[0]) > 0.5 * np.pi:
        return None
    through = feedback @ np.linalg.solve(plant, drive[:, None, :] * np.eye(len(loops)))
    sensitivity = np.linalg.inv(np.eye(len(loops)) - through / integrator[:, :, None])
    opened: Any = 1.0 / np.diagonal(sensitivity, axis1=1, axis2=2) - 1.0
    return [grid_margins(each, omega) for each in opened.T]


def _responses(
    loops: Sequence[JointLoop], moved: Coupling, known: Coupling, shift: ComplexArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """(P (W, n, n), C (W, n, n) times 1 - 1/z where joint i has an integral, these factors (W, n))."""
    first, dt = loops[0], loops[0].dt

    def response(polynomial: FloatArray) -> ComplexArray:
        return np.asarray(np.polyval(polynomial[::-1], shift))

    q, a = (response(first.late_weights(first.order, k)) for k in (0, 2))
    smooth = first.late_weights(first.inertial_order, 0)
    lagged, felt = response(smooth), response(np.convolve(smooth[1:], [1.0, -2.0, 1.0])) / dt**2
    kp, ki = (np.array([getattr(loop, name) for loop in loops]) for name in ("kp", "ki"))
    gain = np.array([loop.k_tau_model for loop in loops])
    integrates = ki > 0.0
    integrator = np.where(integrates, 1.0 - shift[:, None], 1.0)
    plant = (1.0 - shift) ** 2 / dt**2 * moved.inertia[..., None] + shift * moved.gravity[..., None]
    force = felt * moved.sensed_inertia[..., None] + lagged * moved.sensed_gravity[..., None]
    estimate = a * known.inertia[..., None] + q * known.gravity[..., None] - force
    desired = q * known.gravity[..., None] if first.gravity_at == "estimate" else np.zeros_like(estimate)
    error = desired - estimate
    feedback = gain * (
        np.moveaxis(desired, -1, 0).swapaxes(1, 2) * integrator[:, None, :]
        + (kp * integrator + ki * dt * shift[:, None])[:, None, :] * np.moveaxis(error, -1, 0).swapaxes(1, 2)
    )
    plant, feedback = np.moveaxis(plant, -1, 0).copy(), feedback.swapaxes(1, 2).copy()
    for i, loop in enumerate(loops):
        plant[:, i, i] = response(loop.plant) / (loop.drive_gain * loop.k_tau)
        feedback[:, i, i] = response(loop.feedback)
    return plant, feedback, integrator
