"""The joints of a torque loop as closed-form loops, each by itself while the others stand still (`JointLoop`).

Default gains and filter window of a torque loop: the stiffest ones that leave each joint its margins.

Joints are judged in sliding: the loop of each, cut at the effort of its drive, must bear a factor of `GAIN_MARGIN` and
a phase of `PHASE_MARGIN`, while the others are at rest (`joint_loops`) as while their loops are closed (`coupling`).
"""

import logging
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.control.gains import TorqueGains
from drake_tc.control.joint_loop import JointLoop, quick_margins, with_values
from drake_tc.control.stability_margins import Margins
from drake_tc.errors import DrakeTcError, ParamsError
from drake_tc.loops.torque.coupling import Coupling, coupled_margins, coupling
from drake_tc.loops.torque.scenario import Scenario, TorqueLoopSpec, base_source
from drake_tc.loops.torque.stages import LoopDesign
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray


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
    return dict(tied_loops(design, direction).loops)


def tied_loops(design: LoopDesign, direction: float = 0.0) -> "JointLoops":
    """The loops of `joint_loops`, and what ties them together."""
    spec, gains = design.spec, design.gains
    _check_loop(spec)
    filters = spec.filters
    loops = {}
    known = moved = coupling(design.robot, design.posture)
    if design.plant_robot is not design.robot:
        moved = coupling(design.plant_robot, design.posture)
    for i, joint in enumerate(design.robot.joints):
        true, model = design.actuators[i], design.models[i]
        (k_tau, k_v), (k_tau_model, k_v_model) = _drive(true, direction), _drive(model, direction)
        loops[joint] = JointLoop(
            inertia=float(moved.inertia[i, i]) + true.inertia,
            link_inertia=float(known.inertia[i, i]),
            gravity_stiffness=float(moved.gravity[i, i]),
            sensed_inertia=float(known.sensed_inertia[i, i]),
            sensed_gravity=float(known.sensed_gravity[i, i]),
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
        )
    chosen = [settings_of(model, loops[model.joint].inertia) for model in design.models]
    return JointLoops(loops, chosen, known, moved)


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
"""(K6 [-], K7 [s], Kp [-]) of position servos from stiff to soft."""
FREQUENCIES = (100.0, 70.0, 50.0, 35.0, 25.0, 17.0, 12.0, 8.0, 5.5, 4.0)
DAMPING_RATIOS = (0.7, 1.0)
"""w [rad/s] and zeta [-] of joints whose drives have no stiffness of their own, from stiff to soft."""


KEPT = 0.5
"""Share of a joint's K6 that is left it when the other loops disturb it; a shorter window is preferred to less."""
ROUNDS = 4
"""In which joints that disturb each other get other settings."""
Setting = tuple[float, float, float]


def settings_of(model: ActuatorModel, inertia: float) -> tuple[Setting, ...]:
    """(K6, K7, Kp) to choose from, from stiff to soft.

    Of a position servo shares of its own stiffness. Other drives have none, and the error of a joint of inertia I obeys

        eddot + 2 zeta w edot + w^2 e = 0,   K6 = K (1 + Kp) I w^2,   K7 = K (1 + Kp) I 2 zeta w

    Args:
        model: Of the drive, with K its gain.
        inertia: I of joint and rotor [kg m^2].
    """
    if model.drive.kind == "position_servo":
        return SETTINGS
    return tuple(
        (scale * w * w, scale * 2.0 * zeta * w, kp)
        for w in FREQUENCIES
        for kp in (2.0, 1.0, 0.5, 0.2)
        for scale in (model.drive.gain * (1.0 + kp) * inertia,)
        for zeta in DAMPING_RATIOS
    )


def is_sound(found: Margins | None) -> bool:
    """Whether margins of a stable loop suffice."""
    return found is not None and _lacking(found) == 0.0


def _lacking(found: Margins) -> float:
    """What margins lack, each as a share of what they shall be."""
    factor = abs(math.log(found.gain_margin)) if found.gain_margin > 0.0 else 0.0
    return max(0.0, 1.0 - factor / math.log(GAIN_MARGIN)) + max(0.0, 1.0 - abs(found.phase_margin) / PHASE_MARGIN)


@dataclass(frozen=True, eq=False)
class JointLoops:
    """The loops of a robot's joints, and what ties them together.

    Attributes:
        loops: Joint to its loop (`joint_loops`).
        options: One a joint: `settings_of` its drive.
        known, moved: What the controller takes the links for, and what they are.
    """

    loops: Mapping[str, JointLoop]
    options: Sequence[Sequence[Setting]]
    known: Coupling
    moved: Coupling

    def margins(self, changes: Sequence[Mapping[str, float]] | None = None) -> list[Margins] | None:
        """Of every joint while the other loops are closed; None where they are unstable together.

        Args:
            changes: One a joint: values that replace the loop's own.
        """
        loops = list(self.loops.values())
        if changes is not None:
            loops = [with_values(loop, values) for loop, values in zip(loops, changes, strict=True)]
        return coupled_margins(loops, self.moved, self.known)

    def settings(self, window: int, kept: float = 0.0) -> tuple[list[Setting], list[bool]]:
        """The stiffest of `options` that leave every joint its margins with these filters, and whether they do.

        Each joint begins with the stiffest that suffices while the others are at rest. Joints whose margins the closed
        loops of the others take then get, the worst first, the stiffest setting that restores them, or most of them,
        without taking those of others. A joint without any that suffices alone has that of the lowest sensitivity peak.

        Args:
            window: Of the filters [samples].
            kept: Least share of the K6 with which a joint begins.
        """
        options, alone = [], []
        for loop, among in zip(self.loops.values(), self.options, strict=True):
            found = [(s, quick_margins(with_values(loop, _values(s, window)))) for s in among]
            enough = [s for s, each in found if is_sound(each)]
            calm = min(found, key=lambda pair: math.inf if pair[1] is None else pair[1].sensitivity_peak)
            options.append([s for s in enough if s[0] >= kept * enough[0][0]] or [calm[0]])
            alone.append(bool(enough))
        places = [0] * len(options)

        def lacking(at: Sequence[int]) -> FloatArray:
            found = self.margins([_values(each[k], window) for each, k in zip(options, at, strict=True)])
            return np.full(len(at), np.inf) if found is None else np.array([_lacking(each) for each in found])

        now = lacking(places)
        for _ in range(ROUNDS if all(alone) else 0):
            for i in np.argsort(-now, kind="stable").tolist():
                if now[i] > 0.0:
                    tried = np.array([lacking([*places[:i], k, *places[i + 1 :]]) for k in range(len(options[i]))])
                    taken = np.maximum(tried, now) - now if np.isfinite(now[i]) else np.zeros(1)
                    cost = tried[:, i] + taken.sum(axis=-1)
                    places[i] = int(np.argmin(cost)) if np.isfinite(cost.min()) else len(cost) - 1
                    now = lacking(places)
        return [each[k] for each, k in zip(options, places, strict=True)], (now == 0.0).tolist()


def _values(setting: Setting, window: int) -> dict[str, float]:
    return {**dict(zip(("k6", "k7", "kp"), setting, strict=True)), "window": window}


def with_default_gains(design: LoopDesign, *, window: bool) -> LoopDesign:
    """The design with gains, and where asked with a window, that leave each joint of the known robot its margins.

    The window is the longest one with which every joint has such gains, if possible with `KEPT` of the stiffness that
    it could have alone, or the one with which most joints have.

    Args:
        design: Its drives are taken to be what the controller knows; its gains are not used.
        window: Whether the window is chosen too.

    Returns:
        The design; as it is where its loop is none that `joint_loops` has, as with torque sensors.
    """
    known = replace(design, actuators=design.models, plant_robot=design.robot)
    try:
        joints = tied_loops(known)
    except DrakeTcError:
        return design
    tries = [(design.spec.filters.window, 0.0)]
    if window:
        tries = [(samples, kept) for kept in (KEPT, 0.0) for samples in WINDOWS]
    found = []
    for samples, kept in tries:
        settings, sound = joints.settings(samples, kept)
        found.append((sum(sound), samples, settings))
        if all(sound):
            break
    _, samples, settings = max(found, key=lambda each: each[:2])
    k6, k7, kp = np.array(settings).T
    spec = replace(design.spec, filters=replace(design.spec.filters, window=samples))
    return replace(design, spec=spec, gains=TorqueGains.from_servo(design.models, k6, k7, kp))


def weak_joints(design: LoopDesign) -> tuple[str, ...]:
    """A line for each joint whose loop lacks the margins, and what helps; or one on why margins are not known."""
    if design.spec.controller != "torque":
        return ()
    try:
        joints = tied_loops(design)
    except DrakeTcError as error:
        return (f"whether the gains leave margins is not known: {error}",)
    lines, together = [], joints.margins()
    alone = {joint: quick_margins(loop) for joint, loop in joints.loops.items()}
    for i, (joint, loop) in enumerate(joints.loops.items()):
        if alone[joint] is None:
            lines.append(f"joint {joint}: the linear loop is unstable (|z| = {loop.spectral_radius():.4f})")
        elif together is not None and not is_sound(together[i]):
            lines.append(
                f"joint {joint}: gain margin {together[i].gain_margin:.2f}, phase margin"
                f" {math.degrees(together[i].phase_margin):.0f} deg; expected a factor of {GAIN_MARGIN:g} and"
                f" {math.degrees(PHASE_MARGIN):.0f} deg"
            )
    if together is None and not lines:
        lines.append("the linear loops of the joints are unstable together, though each of them is stable by itself")
    return (*lines, "other gains or a shorter window help (`drake-tc tune`)") if lines else ()


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
        _LOG.warning("torque loop: %s", "; ".join(lines))
