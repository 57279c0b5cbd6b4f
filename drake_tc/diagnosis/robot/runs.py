"""A robot's runs at an estimate of what its joints share, and each joint's columns of these parameters."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.model import JointModel
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.diagnosis.search import Progress
from drake_tc.diagnosis.shared.causes import Cause, CauseColumns
from drake_tc.diagnosis.shared.columns_of_runs import corrected
from drake_tc.diagnosis.shared.timing import LinkMomenta
from drake_tc.diagnosis.split import rate_inside
from drake_tc.effects.delay import DELAY_RANGE, CommonDelay
from drake_tc.estimation.robot_loads import at_motors
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray, IntArray

ALL_JOINTS = "all joints"
LONGEST_S = 2.0 * DELAY_RANGE.upper
"""Of a delay to first order [s]."""


@dataclass(frozen=True, eq=False)
class RobotRuns:
    """Training and held-out runs with loads by the robot's file.

    Attributes:
        train, held: Runs.
        rig: With a `RobotLoad`.
        causes: Columns over all runs.
        options: Of the diagnosis. progress: Told how far it is.
        turns: (n, n) of the motors where gears couple joints (`estimation.robot_loads`).
        momenta: Of fitted links whose runs' sampling instants scatter; None elsewhere.
        unmoved: Both splits before the readings of a late encoder were moved in time; None where none were.
    """

    train: Sequence[Run]
    held: Sequence[Run]
    rig: Rig
    causes: CauseColumns
    options: DiagnosisOptions
    progress: Progress = lambda text, share: None
    turns: FloatArray | None = None
    momenta: LinkMomenta | None = None
    unmoved: tuple[Sequence[Run], Sequence[Run]] | None = None

    @property
    def every_cause(self) -> tuple[Cause, ...]:
        """All causes; the last one is a delay of all joints, whose column follows from each joint's own model."""
        stop = int(self.causes.causes[-1].columns.stop)
        late = Cause("delay", ALL_JOINTS, ("delay",), ("s",), slice(stop, stop + 1), possible=(-LONGEST_S, LONGEST_S))
        return (*self.causes.causes, late)

    @property
    def width(self) -> int:
        """Number of shared parameters P."""
        return int(self.every_cause[-1].columns.stop)

    def at(self, delta: FloatArray) -> tuple[list[Run], list[Run]]:
        """Both sides' runs with tau_meas - C delta as torques; delta (P,), of which the delay changes no load."""
        places: IntArray = delta[:-1].nonzero()[0]
        out = []
        for runs in (self.train, self.held):
            made = corrected(runs, self.causes, self.rig.joints, places, delta[places])
            if self.momenta is not None:
                made = self.momenta.added(made, self.rig.joints, places, delta[places])
            out.append(made if self.turns is None else at_motors(self.turns, self.rig.joints, made))
        return out[0], out[1]

    def prepared(self, delta: FloatArray, names: Sequence[str] = ()) -> dict[str, Prepared]:
        """Each joint, or each of these, with its declared model on loads at delta (P,).

        A delay of all joints is part of each model. Where it is negative, all efforts are recorded late.
        """
        train, held = self.at(delta)
        delay = float(delta[-1])
        made = partial(
            prepare_joint,
            common=[Term(CommonDelay(), {"delay": delay})] if delay > 0.0 else [],
            command_held=self.options.command_held,
            sampled_late=min(delay, 0.0) / self.train[0].period,
        )
        return {joint: made(train, held, self.rig, joint) for joint in names or self.rig.joints}

    def columns(self, joint: str, model: JointModel) -> tuple[FloatArray, FloatArray]:
        """(N, P) columns [N m] of one joint in the training and in the held-out rows.

        That of the delay is the mean rate of the effort that acts and the one that is needed, as u - w is d times that
        mean up to d^3.
        """
        made = []
        for split in (model.train, model.held):
            given = split.samples.reduce(over_samples(split.samples, joint, self.causes), fresh=True)
            rate = rate_inside(0.5 * (split.latent + split.modelled), split.samples)
            made.append(np.column_stack([given, split.samples.reduce(rate) / -split.gain]))
        return made[0], made[1]


def over_samples(samples: Samples, joint: str, causes: CauseColumns) -> FloatArray:
    """(T, P) of one joint on the samples' own clock."""
    time, run = samples.signals.time, samples.run_of_sample
    out = np.zeros((time.size, causes.causes[-1].columns.stop))
    for number, name in enumerate(samples.runs):
        inside = run == number
        out[inside] = causes.of(name, joint, time[inside])
    return out
