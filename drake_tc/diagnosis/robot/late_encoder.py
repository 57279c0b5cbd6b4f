"""An encoder that comes late: it makes the loads of all joints wrong, not the balance of its own joint alone.

The search of a single joint knows a late encoder as a delay of the joint's drive, which leaves the other joints as they
are; these then take it for effects of their own. It is therefore looked for on all joints together, beside the links'
parameters (`problem.shared.late_encoder_columns`), and is found if, on the training runs,

- the thresholds `LATE_ENCODER` hold against the declared models, and against a delay of the same joint's drive,
- it leaves less than a delay of all joints, where there is one, and
- the error of no joint grows;

and if it lowers the error of the held-out runs in nearly all of their block resamples. The encoder's readings are then
moved to the time at which they were taken, in all runs, and the diagnosis goes on with these.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.problem.shared.covariance import intervals
from drake_tc.diagnosis.problem.shared.rows import JointRows, fold_grams, with_terms
from drake_tc.diagnosis.problem.shared.stacked import StackedFit, fit_stacked
from drake_tc.diagnosis.result.rig_result import SharedEffect
from drake_tc.diagnosis.result.shared_effects import on_held_out
from drake_tc.diagnosis.robot.all_joints import AllJoints
from drake_tc.diagnosis.thresholds import HELDOUT_CERTAIN, LATE_ENCODER
from drake_tc.effects.delay import DELAY_RANGE, Delay
from drake_tc.types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class EncoderProblem(AllJoints):
    """All joints, whose rows have the columns of late encoders after all others.

    Attributes:
        encoders: (n,) places of these columns, by joint.
    """

    encoders: Mapping[str, int]

    def with_encoder(self, joint: str) -> StackedFit:
        """All joints with the delay of one encoder, to first order; it is the first of delta."""
        columns: IntArray = np.append(self.encoders[joint], self.fitted.columns)
        return fit_stacked(self.rows, columns, np.append(np.inf, self.fitted.tolerance), pooled=True)

    def late(self, joint: str, delay: float, *, held: bool = False) -> list[JointRows]:
        """The rows where the encoder of `joint` comes `delay` [s] late.

        Its own balance holds at the time of its readings: there the effort acts late, and the motion of the others
        comes early in its load. So Coulomb friction changes its sign when the readings do, which no first order tells.
        """
        return [
            self._own(rows, delay, held=held) if rows.joint == joint else self._other(rows, joint, delay)
            for rows in (self.held if held else self.rows)
        ]

    def _other(self, rows: JointRows, joint: str, delay: float) -> JointRows:
        return _less(rows, delay * rows.shared[:, self.encoders[joint]])

    def _own(self, rows: JointRows, delay: float, *, held: bool) -> JointRows:
        prepared = self.prepared[rows.joint]
        terms = (*prepared.terms, Term(Delay(), {"delay": delay}))
        others = [place for joint, place in self.encoders.items() if joint != rows.joint]
        early = rows.shared[:, others].sum(axis=1)
        return _less(with_terms(rows, prepared.held if held else prepared.train, terms), -delay * early)

    def with_drive(self, joint: str, longest: float) -> StackedFit:
        """All joints with the best delay of one joint's drive."""
        number = [rows.joint for rows in self.rows].index(joint)
        prepared = self.prepared[joint]

        def fit(delay: float) -> StackedFit:
            terms = (*prepared.terms, Term(Delay(), {"delay": delay}))
            late = with_terms(self.rows[number], prepared.train, terms)
            rows = [late if k == number else r for k, r in enumerate(self.rows)]
            return fit_stacked(rows, self.fitted.columns, self.fitted.tolerance, pooled=True)

        return fit(_least(lambda delay: self.error(fit(delay)), (0.0, longest)))


def _less(rows: JointRows, known: FloatArray) -> JointRows:
    """The rows without a known part (N,) of the target."""
    target = rows.target - known
    grams = fold_grams(rows.own, rows.shared, target, rows.block, rows.precision)
    return replace(rows, target=target, grams=grams)


def late_encoder(problem: EncoderProblem, common: float | None) -> SharedEffect | None:
    """The encoder that comes late, or None.

    Args:
        problem: The robot.
        common: Error of all joints together with a delay that they share (`EncoderProblem.error`); None: there is none.
    """
    fits = {joint: problem.with_encoder(joint) for joint in problem.encoders}
    joint = min(fits, key=lambda name: problem.error(fits[name]))
    first = float(fits[joint].delta[0])
    if not DELAY_RANGE.lower < first <= DELAY_RANGE.upper:
        return None

    def fit(delay: float) -> StackedFit:
        return fit_stacked(problem.late(joint, delay), problem.fitted.columns, problem.fitted.tolerance, pooled=True)

    delay = _least(lambda delay: problem.error(fit(delay)), (0.5 * first, min(2.0 * first, DELAY_RANGE.upper)))
    found = fit(delay)
    if common is not None and problem.error(found) >= common:
        return None
    others = problem.fitted, problem.with_drive(joint, 2.0 * delay)
    if not all(problem.is_better(found, other, LATE_ENCODER) for other in others):
        return None
    effect = _told(problem, joint, delay, found)
    return effect if effect.stability >= HELDOUT_CERTAIN else None


def _least(error: Callable[[float], float], bounds: tuple[float, float]) -> float:
    """Where the error is least between these bounds."""
    options = {"maxiter": 12}
    return float(minimize_scalar(lambda x: error(float(x)), bounds=bounds, method="bounded", options=options).x)


def _told(problem: EncoderProblem, joint: str, delay: float, found: StackedFit) -> SharedEffect:
    late = problem.late(joint, delay, held=True)
    gain, stability, by_joint = on_held_out((late, found), (problem.held, problem.fitted))
    return SharedEffect(
        id=Delay.id,
        where=joint,
        title="delay of the encoder",
        parameters={"delay": Estimate(delay, "s", (delay, delay), at_bound=False)},
        heldout_gain=gain,
        stability=stability,
        joints={rows.joint: each for rows, each in zip(problem.rows, by_joint, strict=True)},
    )


def estimated_anew(effect: SharedEffect, problem: EncoderProblem) -> SharedEffect:
    """The effect with the delay, and its 95 % interval, by what is left of it once its readings have been moved.

    Args:
        effect: Found.
        problem: Of the runs with the moved readings.
    """
    fitted = problem.with_encoder(effect.where)
    value = effect.parameters["delay"].value + float(fitted.delta[0])
    half = float(intervals(problem.rows, fitted)[0])
    return replace(effect, parameters={"delay": Estimate(value, "s", (value - half, value + half), at_bound=False)})
