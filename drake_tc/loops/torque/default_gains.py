"""The joints of a torque loop as closed-form loops, each by itself while the others stand still (`JointLoop`).

Default gains and filter window of a torque loop: the stiffest ones that leave each joint its margins.

A joint is judged by itself, in sliding and with the others at rest (`joint_loops`): its loop, cut at the drive's
effort, must bear a factor of `GAIN_MARGIN` and a phase of `PHASE_MARGIN`.
"""

import logging
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.actuation.model import ActuatorModel
from drake_tc.control.gains import TorqueGains
from drake_tc.control.joint_loop import JointLoop, quick_margins, with_values
from drake_tc.control.stability_margins import Margins
from drake_tc.errors import DrakeTcError, ParamsError
from drake_tc.loops.torque.scenario import Scenario, TorqueLoopSpec, base_source
from drake_tc.loops.torque.stages import LoopDesign
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot
from drake_tc.robot.tree import PRISMATIC, joint_axes
from drake_tc.types import GRAVITY, FloatArray


def joint_loops(loop: Scenario | LoopDesign, direction: float = 0.0) -> dict[str, JointLoop]:
    """The loop of every joint, in sliding at the posture in which the motion rests.

    In sliding, dry friction is constant and a dead zone is passed, so neither enters; a velocity-sign switch s makes
    the drive's gain K_tau/(1 + s direction). Of the other effects viscous friction and rotor inertia are taken.

    Args:
        loop: In torque control on estimated torques, without predictor and observer.
        direction: Of the sliding: 1, -1, or 0 for the mean of both.

    Raises:
        ParamsError: another loop, a scenario that cannot be built, or numbers that make no loop.
    """
    design = loop if isinstance(loop, LoopDesign) else LoopDesign.of_scenario(loop)
    spec, gains = design.spec, design.gains
    _check_loop(spec)
    filters = spec.filters
    loops = {}
    true_weights = _weights(design.plant_robot, design.posture)
    for i, (joint, weights) in enumerate(_weights(design.robot, design.posture).items()):
        moved = true_weights[joint]
        true, model = design.actuators[i], design.models[i]
        (k_tau, k_v), (k_tau_model, k_v_model) = _drive(true, direction), _drive(model, direction)
        loops[joint] = JointLoop(
            inertia=moved["link_inertia"] + true.inertia,
            k_tau=k_tau,
            k_v=k_v,
            k_tau_model=k_tau_model,
            k_v_model=k_v_model,
            window=filters.window,
            order=filters.encoder_order,
            inertial_order=filters.inertial_order,
            dt=spec.dt,
            kp=float(gains.kp[i]),
            ki=float(gains.ki[i]),
            ks=float(gains.ks[i]),
            kd=float(gains.kd[i]),
            kf=float(gains.kf[0, 0]) if gains.kf.size else 0.0,
            gravity_at=spec.configuration,
            velocity_from=spec.compensation.velocity,
            rotor_model=0.0 if spec.compensation.acceleration == "none" else model.inertia,
            **weights | {"gravity_stiffness": moved["gravity_stiffness"]},
        )
    return loops


def _check_loop(spec: TorqueLoopSpec) -> None:
    """Refuse what `JointLoop` does not have."""
    expected = {"controller": "torque", "torque_from": "estimate", "predictor": None, "observer": None}
    others = [name for name, value in expected.items() if getattr(spec, name) != value]
    if others:
        raise ParamsError(
            "joint loops: expected a loop in torque control (`controller: torque`, `torque_from: estimate`)"
            f" without predictor and observer; it differs in {', '.join(others)}"
        )


def _drive(model: ActuatorModel, direction: float) -> tuple[float, float]:
    """(K_tau, K_v) in sliding."""
    values = {value.key: value.parameters for value in model.effects}
    switch = values.get("velocity_sign_switch", {}).get("switch", 0.0)
    gain = model.drive.gain / (1.0 + switch * direction)
    return gain, gain * values.get("viscous", {}).get("viscous", 0.0)


def _weights(robot: Robot, at: FloatArray) -> dict[str, dict[str, Any]]:
    """Joint to inertia and gravity stiffness of what it moves, and of what lies beyond the F/T sensor."""
    plant: Any = make_plant(robot, 0.0)
    context = plant.CreateDefaultContext()
    positions = np.array(plant.GetPositions(context))
    for name, position in zip(robot.joints, at, strict=True):
        positions[plant.GetJointByName(name).position_start()] = position
    plant.SetPositions(context, positions)
    sensed = [_beyond(plant, mount.joint) for mount in robot.force_torque]
    found: dict[str, dict[str, Any]] = {}
    for name in robot.joints:
        joint = plant.GetJointByName(name)
        moved = plant.GetBodiesKinematicallyAffectedBy([joint.index()])
        beyond = [body for bodies in sensed for body in bodies if body in moved]
        link_inertia, gravity = _about(plant, context, joint, moved)
        inertia, weight = _about(plant, context, joint, beyond) if beyond else (0.0, 0.0)
        found[name] = {
            "link_inertia": link_inertia,
            "gravity_stiffness": gravity,
            "sensed_inertia": inertia,
            "sensed_gravity": weight,
        }
    return found


def _beyond(plant: MultibodyPlant, weld: str) -> list[Any]:
    """Bodies at and beyond a welded sensor joint that move with its child."""
    child = plant.GetJointByName(weld).child_body()
    found = [child.index()]
    for index in plant.GetJointIndices():
        joint: Any = plant.get_joint(index)
        if joint.parent_body().index() in found:
            found.append(joint.child_body().index())
    return found


def _about(plant: Any, context: Any, joint: Any, bodies: list[Any]) -> tuple[float, float]:
    """(inertia [kg m^2], stiffness -d tau_gravity/dq [N m/rad]) of bodies about a joint's axis.

    Of a prismatic joint, (mass [kg], 0 [N/m]): gravity does not change along its axis.
    """
    if joint.type_name() == PRISMATIC:
        return float(plant.CalcSpatialInertia(context, joint.frame_on_parent(), bodies).get_mass()), 0.0
    frame, axis = joint.frame_on_parent(), joint_axes(plant, [joint])[0]
    spatial = plant.CalcSpatialInertia(context, frame, bodies)
    weight = frame.CalcPoseInWorld(context).rotation().matrix().T @ [0.0, 0.0, -GRAVITY * spatial.get_mass()]
    inertia = float(axis @ spatial.CalcRotationalInertia().CopyToFullMatrix3() @ axis)
    return inertia, float(-axis @ np.cross(np.cross(axis, spatial.get_com()), weight))


_LOG = logging.getLogger(__name__)
GAIN_MARGIN = 2.0
"""Least factor on the loop gain, up or down, that brings a joint to its border."""
PHASE_MARGIN = math.radians(40.0)
"""[rad]."""
WINDOWS = (80, 60, 40, 30, 20, 10)
"""Samples of the filters, from little noise to little delay."""
SETTINGS = tuple(
    (k6, k7, kp) for k6 in (1.0, 0.5, 0.25, 0.1) for kp in (2.0, 1.0, 0.5, 0.2) for k7 in (0.0, 0.01, 0.02, 0.04)
)
"""(K6 [-], K7 [s], Kp [-]) from stiff to soft."""


@dataclass(frozen=True)
class Chosen:
    """A joint's setting: gains as in `SETTINGS`, and whether they leave the margins."""

    k6: float
    k7: float
    kp: float
    sound: bool


def is_sound(found: Margins | None) -> bool:
    """Whether margins of a stable loop suffice."""
    if found is None:
        return False
    gain = math.exp(abs(math.log(found.gain_margin))) if found.gain_margin > 0.0 else 0.0
    return gain >= GAIN_MARGIN and abs(found.phase_margin) >= PHASE_MARGIN


def chosen_setting(loop: JointLoop) -> Chosen:
    """The stiffest of `SETTINGS` that leaves a joint its margins, or the one of the lowest sensitivity peak."""
    best, peak = SETTINGS[-1], math.inf
    for k6, k7, kp in SETTINGS:
        found = quick_margins(with_values(loop, {"k6": k6, "k7": k7, "kp": kp}))
        if is_sound(found):
            return Chosen(k6, k7, kp, sound=True)
        if found is not None and found.sensitivity_peak < peak:
            best, peak = (k6, k7, kp), found.sensitivity_peak
    return Chosen(*best, sound=False)


def with_default_gains(design: LoopDesign, *, window: bool) -> LoopDesign:
    """The design with gains, and where asked with a window, that leave each joint of the known robot its margins.

    The window is the longest one with which every joint has such gains, or the one with which most joints have.

    Args:
        design: Its drives are taken to be what the controller knows; its gains are not used.
        window: Whether the window is chosen too.

    Returns:
        The design; as it is where its loop is none that `joint_loops` has, as with torque sensors.
    """
    known = replace(design, actuators=design.models, plant_robot=design.robot)
    try:
        loops = joint_loops(known)
    except DrakeTcError:
        return design
    found = []
    for samples in WINDOWS if window else (design.spec.filters.window,):
        chosen = [chosen_setting(with_values(loop, {"window": samples})) for loop in loops.values()]
        found.append((sum(each.sound for each in chosen), samples, chosen))
        if found[-1][0] == len(loops):
            break
    _, samples, chosen = max(found, key=lambda each: each[:2])
    k6, k7, kp = np.array([(each.k6, each.k7, each.kp) for each in chosen]).T
    spec = replace(design.spec, filters=replace(design.spec.filters, window=samples))
    return replace(design, spec=spec, gains=TorqueGains.from_servo(design.models, k6, k7, kp))


def weak_joints(design: LoopDesign) -> tuple[str, ...]:
    """One line for each joint whose loop lacks the margins; none where the loop is none that `joint_loops` has."""
    try:
        loops = joint_loops(design)
    except DrakeTcError:
        return ()
    lines = []
    for joint, loop in loops.items():
        found = quick_margins(loop)
        if found is None:
            lines.append(f"joint {joint}: the linear loop is unstable (|z| = {loop.spectral_radius():.4f})")
        elif not is_sound(found):
            lines.append(
                f"joint {joint}: gain margin {found.gain_margin:.2f}, phase margin"
                f" {math.degrees(found.phase_margin):.0f} deg; expected a factor of {GAIN_MARGIN:g} and"
                f" {math.degrees(PHASE_MARGIN):.0f} deg"
            )
    return tuple(lines)


def torque_design(
    robot: Robot,
    spec: TorqueLoopSpec | None,
    actuators: Sequence[ActuatorModel],
    models: Sequence[ActuatorModel],
    gains: TorqueGains | None,
) -> LoopDesign:
    """What a loop of the user's own is wired from, gains and window chosen where there are none.

    Args:
        robot: From `load_robot`.
        spec: None: the defaults, with a window for the joints at hand.
        actuators: The simulated drives.
        models: What the controller takes them for.
        gains: None: the stiffest that leave the joints their margins.

    Raises:
        ParamsError: a base that floats and is taken to have no angular acceleration.
    """
    given = TorqueLoopSpec() if spec is None else spec
    base_source(given, robot)
    design = LoopDesign(
        robot=robot,
        plant_robot=robot,
        spec=given,
        actuators=tuple(actuators),
        models=tuple(models),
        gains=TorqueGains.from_servo(models) if gains is None else gains,
        posture=robot.posture,
    )
    return with_default_gains(design, window=spec is None) if gains is None else design


OF_MARGINS = {"filter", "torque_estimator", "inverse_dynamics", "torque_control"}
"""Stages that the margins are those of."""


def warn_of_weak_joints(design: LoopDesign, own: Collection[str] = ()) -> None:
    """Log one warning where joints lack their margins.

    Args:
        design: Of the loop.
        own: Stages and places of the user's own systems, whose loop is not known.
    """
    lines = () if OF_MARGINS & {place.partition(".")[0] for place in own} else weak_joints(design)
    if lines:
        _LOG.warning("torque loop: %s; other gains or a shorter window help (`drake-tc tune`)", "; ".join(lines))
