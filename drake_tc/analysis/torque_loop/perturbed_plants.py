"""Plants that are not what the controller takes them for: drive gains, friction and masses drawn, the model kept."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.actuation.model_file import save_models
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
        save_models(models, file)
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
