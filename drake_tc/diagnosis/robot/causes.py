"""Which causes that no single joint owns are missing: the log evidence of all joints' messages.

A cause that is asked for adds its columns to what the joints share, with a wide prior; an error of a sensor that has a
tolerance is among them anyway, and asked for, it may lie beyond. As the joints' messages hold all columns, the evidence
of every set of causes follows from them without another fit:

    log odds(A) = log p(u_1, ..., u_n | A) + sum of the log prior odds of the causes
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.priors import (
    ALTERNATIVE,
    CAUSE_CONTRIBUTION,
    COMMON,
    GAIN_ERROR,
    MOST_EFFECTS,
    NAMED_FLOORS,
    UNIFORM,
)
from drake_tc.diagnosis.problem.columns import BalanceCoefficients
from drake_tc.diagnosis.robot.joints import RobotFit, Shared
from drake_tc.diagnosis.robot.runs import LONGEST_S, RobotRuns
from drake_tc.diagnosis.shared.causes import FARTHEST, LINK_INERTIA_ID, TITLES, Cause, CauseColumns, Piece
from drake_tc.diagnosis.shared.timing import OwnMotion, late_encoder_columns
from drake_tc.effects.delay import DELAY_RANGE
from drake_tc.estimation.robot_loads import RobotLogs
from drake_tc.logs.record import Run
from drake_tc.types import FloatArray

NAMES: Mapping[str, str] = {**TITLES, "delay": "delay"}
"""Causes that may be named."""


@dataclass(frozen=True, eq=False)
class Causes:
    """The causes of a robot and their priors.

    Attributes:
        causes: All of them.
        wide: (P,) standard deviations of parameters of a cause that is asked for.
        age: Standard deviation of an age that all joints have in common, and that is no delay [s].
        squares: (n, P, P) by joint, mean products of the columns [effort] over the joint's noise floor.
    """

    causes: Sequence[Cause]
    wide: FloatArray
    age: float
    squares: FloatArray

    @classmethod
    def of(cls, fit: RobotFit) -> "Causes":
        """With the prior of what a cause contributes to the joint where it does most.

        That of a delay is uniform over its range, and no gain is off by more than some `GAIN_ERROR`.
        """
        most, squares, age = np.zeros(fit.delta.size), [], 0.0
        for joint in fit.joints.values():
            model = joint.evidence.model
            columns = model.train.gain * joint.columns[0]
            most = np.maximum(most, np.sqrt(np.mean(columns**2, axis=0)) / model.scale)
            known = [spread for channel, (_, spread) in model.ages.items() if channel not in ("torque", "rate")]
            age = max(age, float(np.linalg.norm(known)))
            squares.append(columns.T @ columns / max(len(columns), 1) / joint.prepared.floor**2)
        wide = CAUSE_CONTRIBUTION / np.where(most > 0.0, most, np.inf)
        for cause in fit.runs.every_cause:
            if cause.id == "delay":
                wide[cause.columns] = UNIFORM * 2.0 * DELAY_RANGE.upper
            if cause.id == "ft_gain":
                wide[cause.columns] = np.minimum(wide[cause.columns], GAIN_ERROR)
        return cls(
            fit.runs.every_cause, np.where(most > 1e-9 * most.max(initial=0.0), wide, 0.0), age, np.array(squares)
        )

    @property
    def candidates(self) -> list[Cause]:
        """Those that may be named and that the joints tell anything of."""
        return [c for c in self.causes if c.id in NAMES and (self.wide[c.columns] > 0.0).any()]

    def shared(self, asked: Sequence[Cause]) -> Shared:
        """What the joints share: errors within tolerance, and the causes that are asked for.

        Where the mass or the centre of a link is wrong, its inertia may be, too.
        """
        places, deviation = [], []
        links = {c.where for c in asked if c.id in ("link_mass", "link_com")}
        for cause in self.causes:
            within = np.array(cause.tolerance or [0.0] * cause.size)
            if cause.id == LINK_INERTIA_ID and cause.where in links:
                within = np.array(cause.prior)
            size = np.hypot(within, self.wide[cause.columns]) if cause in asked else within
            for number, each in enumerate(size):
                if each > 0.0:
                    places.append(cause.columns.start + number)
                    deviation.append(float(each))
        return Shared(np.array(places, dtype=np.int64), np.array(deviation))

    def sizes(self, cause: Cause, delta: FloatArray) -> FloatArray:
        """(n,) RMS of a cause's part of each joint's effort over the joint's noise floor, at delta (P,)."""
        own = delta[cause.columns]
        return np.asarray(np.sqrt(np.einsum("i,jik,k->j", own, self.squares[:, cause.columns, cause.columns], own)))

    def prior_odds(self, asked: Sequence[Cause]) -> float:
        """Log prior odds of these causes."""
        return COMMON * len(asked)

    def log_odds(self, fit: RobotFit, asked: Sequence[Cause]) -> float:
        """Of these causes beside the joints' sets as they are; minus infinity for impossible or very small values."""
        shared = self.shared(asked)
        late = self.causes[-1]
        if late not in asked:  # clocks and buses that all joints share have an age
            places = np.append(shared.places, late.columns.start)
            shared = Shared(places, np.append(shared.deviation, self.age))
        told = shared.belief(fit.messages)
        delta = np.zeros_like(fit.delta)
        delta[shared.places] = told.mean
        for cause in asked:
            value = cause.physical(delta[cause.columns])
            if np.max(self.sizes(cause, delta)) < NAMED_FLOORS:
                return -np.inf
            if cause.id == "payload" and np.linalg.norm(value[1:4]) > FARTHEST * abs(value[0]):
                return -np.inf
            if (value < cause.possible[0]).any() or (value > cause.possible[1]).any():
                return -np.inf
        return told.log_evidence + self.prior_odds(asked)


@dataclass(frozen=True, eq=False)
class Named:
    """The most probable causes, and by cause those that may stand in its place."""

    causes: tuple[Cause, ...]
    alternatives: Mapping[str, tuple[Cause, ...]]

    @classmethod
    def none(cls) -> "Named":
        """No cause."""
        return cls((), {})


def most_probable(fit: RobotFit, causes: Causes) -> Named:
    """The most probable set of causes beside the joints' sets, by adding, exchanging and leaving out."""
    best: tuple[Cause, ...] = ()
    held = causes.log_odds(fit, best)
    while True:
        tried = {_key(each): each for each in _neighbours(best, causes.candidates)}
        odds = {key: causes.log_odds(fit, each) for key, each in tried.items()}
        top = max(odds, key=lambda key: odds[key], default=frozenset[str]())
        if not odds or odds[top] <= held:
            return Named(best, _alternatives(fit, causes, best, held))
        best, held = tried[top], odds[top]


def _key(causes: Sequence[Cause]) -> frozenset[str]:
    return frozenset(c.key for c in causes)


def _neighbours(best: tuple[Cause, ...], candidates: Sequence[Cause]) -> list[tuple[Cause, ...]]:
    others = [c for c in candidates if c not in best]
    less = [tuple(c for c in best if c is not gone) for gone in best]
    more = [(*best, other) for other in others] if len(best) < MOST_EFFECTS else []
    return [*more, *less, *((*rest, other) for rest in less for other in others)]


def _alternatives(fit: RobotFit, causes: Causes, best: tuple[Cause, ...], held: float) -> dict[str, tuple[Cause, ...]]:
    """By chosen cause, others that are nearly as probable in its place."""
    out = {}
    for cause in best:
        rest = [c for c in best if c is not cause]
        near = [c for c in causes.candidates if c not in best and causes.log_odds(fit, [*rest, c]) > held - ALTERNATIVE]
        out[cause.key] = tuple(near)
    return out


def with_encoders(logs: RobotLogs, fit: RobotFit) -> RobotRuns:
    """The robot's runs with columns of late encoders beside all others; as they are where no encoder tells its delay.

    Gears that couple joints have their encoders at the motors, and a servo's effort holds the position: there a late
    encoder acts as viscous friction.

    Args:
        logs: The robot.
        fit: Its joints' declared models, which tell links, viscous friction and inertia.
    """
    runs = fit.runs
    if logs.links is None or runs.turns is not None or "position_servo" in runs.rig.drive.values():
        return runs
    own = {}
    for name, joint in fit.joints.items():
        rotor = joint.prepared.train.samples.signals.rotor_inertia
        found = BalanceCoefficients.of(joint.best.terms, joint.best.beta, rotor)
        own[name] = OwnMotion(found.viscous, found.inertia + rotor)
    pi = logs.links.nominal - fit.moved()[: logs.links.nominal.size]
    late = late_encoder_columns(logs, logs.links, [*runs.train, *runs.held], pi, own)
    return replace(runs, causes=_beside(runs.causes, late))


def _beside(first: CauseColumns, second: CauseColumns) -> CauseColumns:
    """Both sets of columns over the same stretches; delays are as long as a first order allows at most."""
    at = first.causes[-1].columns.stop
    moved = [
        replace(c, columns=slice(at + c.columns.start, at + c.columns.stop), possible=(0.0, LONGEST_S))
        for c in second.causes
    ]
    pieces = {
        run: tuple(
            Piece(a.time, np.concatenate([a.values, b.values], axis=2))
            for a, b in zip(made, second.pieces[run], strict=True)
        )
        for run, made in first.pieces.items()
    }
    return CauseColumns((*first.causes, *moved), first.joints, pieces)


def in_time(runs: Sequence[Run], joint: str, delay: float) -> list[Run]:
    """The runs with the readings of one encoder at the time at which they were taken, q_j(t + d).

    The end of each stretch, whose readings came after it, is not used.
    """
    out = []
    for run in runs:
        segment, moved = run.segment.copy(), {}
        names = [name for name in (f"{joint}/position", f"{joint}/velocity") if name in run.columns]
        for part in run.segments():
            segment[part][run.time[part] + delay > run.time[part][-1]] = -1
        for name in names:
            values = np.array(run.columns[name])
            for part in run.segments():
                values[part] = np.interp(run.time[part] + delay, run.time[part], run.columns[name][part])
            moved[name] = values
        out.append(replace(run, columns=dict(run.columns) | moved, segment=segment))
    return out
