"""Default gains and filter window of a torque loop: the stiffest ones that leave each joint its margins.

A joint is judged by itself, in sliding and with the others at rest (`joint_loops`): its loop, cut at the drive's
effort, must bear a factor of `GAIN_MARGIN` and a phase of `PHASE_MARGIN`.
"""

import logging
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.control.gains import TorqueGains
from drake_tc.control.joint_loop import JointLoop, quick_margins, with_values
from drake_tc.control.stability_margins import Margins
from drake_tc.errors import DrakeTcError
from drake_tc.loops.torque.joint_loops import joint_loops
from drake_tc.loops.torque.parts import LoopDesign
from drake_tc.loops.torque.scenario import TorqueLoopSpec, base_source
from drake_tc.robot.robot import Robot

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
