"""Fit on some runs, choose the missing effects there, and predict another run that took no part."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.data.preparation import build_samples, context_of
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.diagnosis.selection.joint import candidates, search
from drake_tc.diagnosis.thresholds import JOINT
from drake_tc.effects.library import LIBRARY, effect
from drake_tc.logs.common_rate import at_common_period
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

Features = Callable[[Samples], FloatArray]


@dataclass(frozen=True)
class HeldOut:
    """One held-out run and the models that were fitted without it.

    Attributes:
        train, held: Columns of both sides, with the same filters.
        baseline, chosen: Without and with the effects that the search added.
    """

    train: Columns
    held: Columns
    baseline: Fit
    chosen: Fit

    def torque_error(self, model: Fit) -> float:
        """RMS [N m] of the held-out torque, predicted from effort and motion."""
        return _rms(self.held.target - self.held.design(model.terms) @ model.beta)

    def command_error(self, model: Fit) -> float:
        """RMS of the held-out command, predicted from motion and load [effort]."""
        return self.torque_error(model) * model.gain

    def command_rms(self) -> float:
        """RMS of the held-out command itself [effort]."""
        return _rms(self.held.effort(()))

    def torque_error_of(self, features: Features) -> float:
        """RMS [N m] on the held-out run of another model, linear in its features (N, k), fitted on the same rows."""
        theta = np.linalg.lstsq(features(self.train.samples), self.train.target, rcond=None)[0]
        return _rms(self.held.target - features(self.held.samples) @ theta)

    @property
    def found(self) -> tuple[str, ...]:
        """Keys of the effects that were added."""
        known = {t.effect.key for t in self.baseline.terms}
        return tuple(t.effect.key for t in self.chosen.terms if t.effect.key not in known)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def hold_out(
    train: Sequence[Run], held: Run, rig: Rig, width_s: float, left_out: Collection[str], floor: float
) -> HeldOut:
    """Fit viscous and Coulomb friction, search for what is missing on `train`, and prepare `held`.

    Args:
        train: Runs to fit and choose on; brought to one period if they differ.
        held: The run to predict.
        rig: Of one joint.
        width_s: Width of the kernel through which everything passes twice [s].
        left_out: Ids of effects that the rig rules out.
        floor: Noise floor of the command [effort].

    Raises:
        IdentificationError: a side on which the joint never resolvably moves.
    """
    joint = rig.joints[0]
    load = rig.load[joint]
    link = load.inertia if isinstance(load, Pendulum) else 0.0
    sides = [build_samples(runs, rig, joint, width_s) for runs in (at_common_period(train), [held])]
    sides = [replace(s, signals=replace(s.signals, link_inertia=link)) for s in sides]
    context = context_of(sides[0], rig, joint)
    declared = [Term(effect("viscous")), Term(effect("coulomb"))]
    first = Columns(sides[0])
    plain = fit(first, declared)
    columns, other = (c.with_model(plain.terms, plain.beta, servo=False) for c in (first, Columns(sides[1])))
    known = ["viscous", "coulomb", *(k.partition(".")[0] for k in rig.declared[joint]), *left_out]
    usable, _ = candidates(LIBRARY, context, known)
    result = search(columns, declared, usable, context, floor, JOINT)
    return HeldOut(columns, other, result.baseline, result.chosen)
