"""All joints of a robot, each with its own model, beside what they share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.diagnose import Decided, asked_of, decided, joint_model
from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.linear import Prior
from drake_tc.diagnosis.model import JointModel, SharedColumns
from drake_tc.diagnosis.priors import NEGLIGIBLE
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.robot.messages import Belief, Message, belief, message, message_of_both, residual_at
from drake_tc.diagnosis.robot.runs import RobotRuns
from drake_tc.diagnosis.search import find
from drake_tc.diagnosis.shared.causes import Cause
from drake_tc.types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Shared:
    """Which parameters all joints share, of all P of a robot.

    Attributes:
        places: (p,) of them. deviation: (p,) standard deviations of their prior, around 0.
    """

    places: IntArray
    deviation: FloatArray

    @classmethod
    def within_tolerance(cls, causes: Sequence[Cause]) -> "Shared":
        """Errors of sensors within tolerance, and links that are fitted."""
        known = [(c.columns.start + k, size) for c in causes for k, size in enumerate(c.tolerance) if size > 0.0]
        return cls(np.array([k for k, _ in known], dtype=np.int64), np.array([size for _, size in known]))

    def belief(self, messages: Sequence[Message]) -> Belief:
        """What prior and messages know of them (p,); all others are 0."""
        return belief(np.zeros(self.places.size), self.deviation, [m.of(self.places) for m in messages])


@dataclass(frozen=True, eq=False)
class RobotJoint:
    """One joint with its set of effects.

    Attributes:
        prepared: With loads at the estimate of the shared parameters.
        columns: (N, P) [N m] of all parameters, in the training and the held-out rows.
        evidence: Under the noise that the set leaves. best: the set.
        message: What it says of all P parameters.
        at: (P,) the estimate at which its loads are.
        decision: Of its search; None before one.
    """

    prepared: Prepared
    columns: tuple[FloatArray, FloatArray]
    evidence: Evidence
    best: Scored
    message: Message
    at: FloatArray
    decision: Decided | None = None

    def moved_floors(self, delta: FloatArray) -> float:
        """RMS of what its load at delta (P,) differs from that on which it rests, over the noise floor."""
        return rms(self.columns[0] @ (delta - self.at)) * self.evidence.model.train.gain / self.prepared.floor

    @cached_property
    def message_of_both(self) -> Message:
        """The message of the training and the held-out rows."""
        return message_of_both(self.evidence, self.best, self.columns).moved(-self.at)


@dataclass(frozen=True, eq=False)
class RobotFit:
    """All joints at one estimate of what they share.

    Attributes:
        runs: Of the robot.
        shared: What the joints share.
        delta: (P,) the estimate.
        joints: By name.
    """

    runs: RobotRuns
    shared: Shared
    delta: FloatArray
    joints: Mapping[str, RobotJoint]

    @property
    def messages(self) -> list[Message]:
        """What each joint says of all P parameters."""
        return [joint.message for joint in self.joints.values()]

    def belief(self) -> Belief:
        """What all joints know of the shared parameters."""
        return self.shared.belief(self.messages)

    def others(self, name: str) -> list[Message]:
        """What all joints but one say."""
        return [joint.message for other, joint in self.joints.items() if other != name]

    @property
    def log_odds(self) -> float:
        """Log evidence of all joints together and the log prior odds of their sets."""
        return self.belief().log_evidence

    def held_out(self, shared: Shared) -> dict[str, FloatArray]:
        """By joint, the residual (N,) of the held-out rows [effort] where these parameters alone are not 0."""
        delta = np.zeros_like(self.delta)
        delta[shared.places] = shared.belief(self.messages).mean
        return {name: residual_at(j.evidence, j.best, j.columns, delta - j.at) for name, j in self.joints.items()}

    def predictive(self, shared: Shared) -> float:
        """Log p(held-out rows | training rows) of all joints where these parameters alone are not 0, and a constant."""
        both = shared.belief([joint.message_of_both for joint in self.joints.values()])
        return both.log_evidence - shared.belief(self.messages).log_evidence

    @property
    def rows(self) -> int:
        """Rows of all joints that count."""
        return sum(joint.evidence.model.train.rows.index.size for joint in self.joints.values())

    def moved(self) -> FloatArray:
        """(P,) the most probable parameters."""
        out = np.zeros_like(self.delta)
        out[self.shared.places] = self.belief().mean
        return out


def declared_fit(
    runs: RobotRuns, shared: Shared, delta: FloatArray, before: RobotFit | None = None, *, tempered: bool = False
) -> RobotFit:
    """All joints with their declared models; what each knows of the others is that of the fit before.

    Where the declared models may lack much (`tempered`), as many rows of a joint count as its residual has independent
    ones; elsewhere the noise is the one that they leave.
    """
    joints = {}
    for name, prepared in runs.prepared(delta).items():
        alone = joint_model(prepared)
        columns = runs.columns(name, alone)
        known = shared.belief([] if before is None else before.others(name))
        model = with_shared(alone, columns, shared, known, delta, prepared.floor)
        start = Evidence(model)
        evidence = start.tempered(model.declared) if tempered else start.heard(model.declared)
        best = evidence.score(model.declared)
        joints[name] = RobotJoint(prepared, columns, evidence, best, _told(evidence, best, columns[0], delta), delta)
    return RobotFit(runs, shared, delta, joints)


def searched_fit(before: RobotFit, delta: FloatArray, names: Sequence[str]) -> RobotFit:
    """These joints searched anew on loads at delta (P,), in turn, each beside what the others say by then."""
    shared, joints = before.shared, dict(before.joints)
    for number, (name, prepared) in enumerate(before.runs.prepared(delta, names).items()):
        before.runs.progress(name, number / len(names))
        alone = joint_model(prepared)
        columns = before.runs.columns(name, alone)
        known = shared.belief(replace(before, joints=joints).others(name))
        model = with_shared(alone, columns, shared, known, delta, prepared.floor)
        asked = asked_of(prepared, before.runs.options)
        decision = decided(find(Evidence(model).heard(model.declared, spread=False), asked.usable), asked.usable)
        evidence = decision.found.evidence
        told = _told(evidence, decision.best, columns[0], delta)
        joints[name] = RobotJoint(prepared, columns, evidence, decision.best, told, delta, decision)
    return RobotFit(before.runs, shared, delta, joints)


def tempered(fit: RobotFit) -> RobotFit:
    """The same sets where rows count alike, as many of them as are independent."""
    joints = {}
    for name, joint in fit.joints.items():
        evidence = joint.evidence.tempered(joint.best.terms)
        best = evidence.refined(evidence.score(joint.best.terms))
        told = _told(evidence, best, joint.columns[0], joint.at)
        joints[name] = replace(joint, evidence=evidence, best=best, message=told)
    return replace(fit, joints=joints)


def _told(evidence: Evidence, best: Scored, columns: FloatArray, delta: FloatArray) -> Message:
    """What a joint says of all parameters, on loads at delta (P,)."""
    return message(evidence, best, columns).moved(-delta)


def with_shared(
    model: JointModel,
    columns: tuple[FloatArray, FloatArray],
    shared: Shared,
    known: Belief,
    delta: FloatArray,
    floor: float,
) -> JointModel:
    """The model with the shared parameters that its rows tell, as independent coefficients of unit variance.

    With the mean m and the covariance R R' that the others know, the load at delta errs by C R x with
    x ~ N(R^-1 (m - delta), I). Directions x along which C R is far below the noise floor [effort] are left out.
    """
    if not shared.places.size:
        return model
    train, held = (c[:, shared.places] @ known.root for c in columns)
    size, turn = np.linalg.eigh(train.T @ train / max(len(train), 1))
    kept = size > (NEGLIGIBLE * floor / model.train.gain) ** 2
    mean = np.linalg.solve(known.root, known.mean - delta[shared.places]) @ turn[:, kept]
    prior = Prior(mean, np.ones(mean.size), np.zeros(mean.size, dtype=np.bool_))
    return replace(model, shared=SharedColumns(train @ turn[:, kept], held @ turn[:, kept], prior))
