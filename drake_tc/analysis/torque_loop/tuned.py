"""What a tuning is to a scenario: fields that it reads, and the simulations that confirm it."""

from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from drake_tc.analysis.sweep import sweep
from drake_tc.analysis.torque_loop.perturbed_plants import Compared, Spread, compare_on_plant
from drake_tc.analysis.tuning import Tuning
from drake_tc.loops.advancing import Progress
from drake_tc.loops.torque.parts import loop_robot
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.types import FloatArray

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
