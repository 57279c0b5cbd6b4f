"""A robot's runs at an estimate of what its joints share, and each joint's columns of these parameters."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.diagnosis.problem.shared.causes import CauseColumns
from drake_tc.diagnosis.problem.shared.correction import corrected
from drake_tc.diagnosis.problem.shared.momentum import LinkMomenta
from drake_tc.diagnosis.problem.shared.rows import over_samples
from drake_tc.diagnosis.search import Progress
from drake_tc.estimation.coupled_gears import at_motors
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class RobotRuns:
    """Training and held-out runs with loads by the robot's file.

    Attributes:
        train, held: Runs.
        rig: With a `RobotLoad`.
        causes: Columns over all runs.
        options: Of the diagnosis. progress: Told how far it is.
        turns: (n, n) of the motors where gears couple joints (`estimation.coupled_gears`).
        momenta: Of fitted links whose runs' sampling instants scatter; None elsewhere.
    """

    train: Sequence[Run]
    held: Sequence[Run]
    rig: Rig
    causes: CauseColumns
    options: DiagnosisOptions
    progress: Progress = lambda text, share: None
    turns: FloatArray | None = None
    momenta: LinkMomenta | None = None

    @property
    def width(self) -> int:
        """Number of shared parameters P."""
        return int(self.causes.causes[-1].columns.stop)

    def at(self, delta: FloatArray) -> tuple[list[Run], list[Run]]:
        """Both sides' runs with tau_meas - C delta as torques; delta (P,)."""
        places: IntArray = delta.nonzero()[0]
        out = []
        for runs in (self.train, self.held):
            made = corrected(runs, self.causes, self.rig.joints, places, delta[places])
            if self.momenta is not None:
                made = self.momenta.added(made, self.rig.joints, places, delta[places])
            out.append(made if self.turns is None else at_motors(self.turns, self.rig.joints, made))
        return out[0], out[1]

    def prepared(self, delta: FloatArray) -> dict[str, Prepared]:
        """Each joint with its declared model on loads at delta (P,)."""
        train, held = self.at(delta)
        options = self.options
        made = partial(
            prepare_joint,
            width_s=options.width_s,
            common=options.common,
            command_held=options.command_held,
            sampled_late=options.effort_age,
        )
        return {joint: made(train, held, self.rig, joint) for joint in self.rig.joints}

    def columns(self, joint: str, prepared: Prepared) -> tuple[FloatArray, FloatArray]:
        """(N, P) columns [N m] of one joint in the training and in the held-out rows."""
        train, held = (
            each.samples.reduce(over_samples(each.samples, joint, self.causes), fresh=True)
            for each in (prepared.train, prepared.held)
        )
        return train, held
