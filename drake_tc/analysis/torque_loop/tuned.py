"""What a tuning is to a scenario: fields that it reads, and the simulations that confirm it.

Plants that are not what the controller takes them for: drive gains, friction and masses drawn, the model kept.
"""

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.actuation.model_file import save_models
from drake_tc.analysis.sweep import sweep
from drake_tc.analysis.tuning import Tuning
from drake_tc.loops.recording import Progress
from drake_tc.loops.torque.parts import actuator_models, loop_robot
from drake_tc.loops.torque.running import simulate_scenario
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.robot.plant import make_plant
from drake_tc.types import FloatArray

DRY = ("coulomb", "deadzone", "stribeck")
"""Effects that are drawn as dry friction."""


@dataclass(frozen=True)
class Spread:
    """Half widths of the uniform factors about 1, one drawn a joint or link.

    Attributes:
        k_tau: Of the drives' gains.
        k_v: Of K_v = K_tau b.
        dry: Of Coulomb friction and dead zone.
        mass: Of the links' masses and inertias, in the plant alone.
    """

    k_tau: float = 0.15
    k_v: float = 0.15
    dry: float = 0.5
    mass: float = 0.1


@dataclass(frozen=True)
class Compared:
    """One perturbed plant under several settings: what a point of the sweep is.

    Attributes:
        scenarios: Settings of one and the same experiment.
        spread: How far the plant may be off.
        begin: Errors are evaluated from here on [s].
    """

    scenarios: tuple[Scenario, ...]
    spread: Spread
    begin: float


def compare_on_plant(point: Compared, seed: int) -> FloatArray:
    """(settings, n) RMS tracking error [rad] on the plant that the seed draws; infinite where a joint runs away.

    The plant and its sensors' noise are the same under every setting.
    """
    first = point.scenarios[0]
    generator = np.random.default_rng(seed)
    robot = loop_robot(first)
    models = {joint: _drawn(model, point.spread, generator) for joint, model in actuator_models(first, robot).items()}
    masses = _masses(first, robot.joints, point.spread, generator)
    noise = int(generator.integers(2**31))
    with TemporaryDirectory() as folder:
        file = Path(folder) / "actuators.yaml"
        save_models(models, file, shared=robot.changes.causes, links=robot.changes.fitted)
        rows = []
        for scenario in point.scenarios:
            known = scenario.model or scenario.actuators or str(Path(str(robot.actuators)).resolve())
            perturbed = replace(scenario, actuators=str(file), model=known, masses=masses, seed=noise)
            recording = simulate_scenario(perturbed, allow_runaway=True)
            error = recording.tracking_error[recording.time >= point.begin]
            ended = recording.time[-1] >= scenario.duration - 2.0 * scenario.dt
            rows.append(np.sqrt(np.mean(error**2, axis=0)) if ended else np.full(len(robot.joints), np.inf))
    return np.array(rows)


def _factor(width: float, generator: np.random.Generator) -> float:
    return float(generator.uniform(1.0 - width, 1.0 + width))


def _drawn(model: ActuatorModel, spread: Spread, generator: np.random.Generator) -> ActuatorModel:
    """The actuator with K_tau, K_v and dry friction drawn."""
    gain, k_v, dry = (_factor(width, generator) for width in (spread.k_tau, spread.k_v, spread.dry))

    def changed(value: EffectValue) -> EffectValue:
        factor = k_v / gain if value.key == "viscous" else dry if value.key in DRY else 1.0
        parameters = {k: v * factor if k == value.key else v for k, v in value.parameters.items()}
        return replace(value, parameters=parameters, ci95={})

    drive = replace(model.drive, gain=model.drive.gain * gain)
    return replace(model, drive=drive, effects=tuple(map(changed, model.effects)))


def _masses(
    scenario: Scenario, joints: tuple[str, ...], spread: Spread, generator: np.random.Generator
) -> Mapping[str, float]:
    """A factor for the link that each joint moves."""
    plant = make_plant(loop_robot(scenario), 0.0)
    links = [plant.GetJointByName(joint).child_body().name() for joint in joints]
    return {link: _factor(spread.mass, generator) for link in links}


EXACT = Spread(0.0, 0.0, 0.0, 0.0)


def tuned_fields(tuning: Tuning) -> dict[str, Any]:
    """`gains` and `filters` as a scenario file has them, of the joints that were tuned."""
    chosen = {joint.joint: joint.after.setting for joint in tuning.joints}
    gains = {
        name: {"kp": float(f"{s.kp:.6g}"), "ki": float(f"{s.ki:.6g}"), "k7": float(f"{s.k7:.6g}")}
        for name, s in chosen.items()
    }
    return {"gains": {"by_joint": gains}, "filters": {"window": tuning.window, "encoder_order": tuning.order}}


def tuned_scenario(scenario: Scenario, tuning: Tuning) -> Scenario:
    """The scenario with the tuned window and gains; joints that were not tuned keep theirs."""
    fields = tuned_fields(tuning)
    merged = {name: dict(gains) for name, gains in scenario.gains.by_joint.items()}
    for joint, gains in fields["gains"]["by_joint"].items():
        merged[joint] = {**merged.get(joint, {}), **gains}
    filters = replace(scenario.filters, **fields["filters"])
    return replace(scenario, gains=replace(scenario.gains, by_joint=merged), filters=filters)


LEAST = 1e-9
"""An RMS error below this counts as this [rad]."""


@dataclass(frozen=True, eq=False)
class Confirmed:
    """RMS tracking errors [rad] of the present and the tuned setting, simulated in the complete loop.

    Attributes:
        joints: Names.
        nominal: (M, 2, n) on the plant as it is modelled, one row a motion.
        plants: (P, 2, n) on perturbed plants, on the first motion.
    """

    joints: tuple[str, ...]
    nominal: FloatArray
    plants: FloatArray

    def ratio(self, tuning: Tuning) -> float:
        """Tuned over present on the first motion, geometric mean over the joints that were tuned."""
        rows = [self.joints.index(joint.joint) for joint in tuning.joints]
        before, after = np.maximum(self.nominal[0][:, rows], LEAST)
        return float(np.exp(np.mean(np.log(after / before))))

    @property
    def plant_ratios(self) -> FloatArray:
        """(P,) tuned over present, geometric mean over the joints; infinite where a joint ran away."""
        return np.asarray(np.exp(np.mean(np.log(self.plants[:, 1] / self.plants[:, 0]), axis=1)))


def confirm(
    motions: list[tuple[Scenario, float]],
    tuning: Tuning,
    plants: int = 0,
    spread: Spread | None = None,
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
    seed: int = 0,
) -> Confirmed:
    """Simulate the present and the tuned setting beside each other.

    Args:
        motions: Scenarios, each with the time from which its errors are evaluated [s].
        tuning: Of the joints.
        plants: Perturbed plants, on the first of the motions.
        spread: How far these are off; None: the default.
        executor: As `sweep`.
        progress: Told how many simulations are done, and which share.
        seed: Of the plants.

    Raises:
        SweepError: a simulation that failed.
    """

    def point(scenario: Scenario, begin: float, how: Spread) -> Compared:
        return Compared((scenario, tuned_scenario(scenario, tuning)), how, begin)

    points = [point(*motion, EXACT) for motion in motions]
    points += [point(*motions[0], Spread() if spread is None else spread)] * plants
    found = sweep(compare_on_plant, points, executor=executor, chunk=1, progress=progress, seed=seed)
    first = len(motions)
    joints = loop_robot(motions[0][0]).joints
    drawn = np.array(found[first:]).reshape(plants, 2, len(joints))
    return Confirmed(joints, np.array(found[:first]), drawn)
