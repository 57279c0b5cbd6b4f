"""Changes of an assumption on an arm's set-up by one thing that is often wrong.

A change says what it is, so that a report can say what to change in the rig or robot file.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.optimize import minimize

from drake_tc.diagnosis.result.rig_result import SET_UP_ERRORS, SetUpErrorKind
from drake_tc.diagnosis.set_up.balance import ArmBalance, Balance, SetUp
from drake_tc.diagnosis.shared.causes import FARTHEST
from drake_tc.types import FloatArray, IntArray

ZERO_STEP = np.pi / 4.0
"""Of the zeros that are tried before the best one is refined [rad]."""
DIRECTIONS = np.array(
    [*np.eye(3), *-np.eye(3), *([x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0))]
)
"""Of gravity, before the best one is refined."""
OTHER_GAIN = 1.5
"""Factor between a fitted and a declared drive gain from which the declared one is called wrong: a smaller difference
may be an effect of the joint, such as friction that depends on the load."""
ONE_OTHER_GAIN = 1.05
"""The same of a single joint, where another gain must halve its error: data sheets know a motor to 5 or 10 %."""
NEIGHBOURS = 2
"""How many joints a gear that couples two of them may lie apart, counted along the arm."""
TURNS = (-1.0, -0.3, 0.3, 1.0)
"""Of a motor for one turn of another joint, before the best one is refined: a bevel gear at a wrist gives 1."""
LEAST_TURN = 0.1
"""Determinant of the motors' turns for those of the joints, at least: with 0, some motion turns no motor."""
NO_GEAR = 1e3
"""Error of what cannot be a gear."""
EVALUATIONS = 60
"""Of a refinement, at most."""


@dataclass(frozen=True, eq=False)
class Change:
    """One change.

    Attributes:
        kind: What.
        joints: (k,) places of the joints that it concerns; empty for gravity and a payload.
        set_up: The assumption with it.
        runs: That carry a payload.
    """

    kind: SetUpErrorKind
    joints: tuple[int, ...]
    set_up: SetUp
    runs: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Tried:
    """A change and how well it fits."""

    change: Change
    balance: Balance


def tried_changes(arm: ArmBalance, start: SetUp) -> list[Tried]:
    """Every change of one thing, fitted."""
    found = [*_efforts(arm, start), *_reversed(arm, start), *_exchanged_columns(arm, start), *_zeros(arm, start)]
    found += [_gravity(arm, start), *_coupled(arm, start), *payloads(arm, start)]
    return sorted(found, key=_simplest_first)


def _simplest_first(tried: Tried) -> tuple[int, int, float]:
    """Kind, number of joints, and how far the links are from the robot's file: mirrored arms fit as well otherwise."""
    return SET_UP_ERRORS.index(tried.change.kind), len(tried.change.joints), tried.balance.departure


def _efforts(arm: ArmBalance, start: SetUp) -> Iterator[Tried]:
    """Changes that leave the motion as it is."""
    columns = arm.columns(start)

    def fitted(kind: SetUpErrorKind, joints: tuple[int, ...], set_up: SetUp) -> Tried:
        return Tried(Change(kind, joints, set_up), arm.fit(set_up, columns))

    n = start.zero.size
    held = np.flatnonzero(~start.free & arm.tells_gain).tolist()
    for j in np.flatnonzero(arm.own_effort).tolist():
        yield fitted("effort_reversed", (j,), replace(start, effort=start.effort * _flip(n, j)))
    for pair in combinations(np.flatnonzero(arm.own_effort).tolist(), 2):
        exchanged = replace(start, effort_source=_exchanged(start.effort_source, pair))
        yield fitted("efforts_exchanged", pair, exchanged)
    for joints in (*((j,) for j in held), *([tuple(held)] if len(held) > 1 else [])):
        yield from _other_gains(arm, start, joints, columns)


def gains_of_one_joint(arm: ArmBalance, start: SetUp) -> list[Tried]:
    """Another drive gain of each single joint whose gain is declared, best first."""
    columns = arm.columns(start)
    held = np.flatnonzero(~start.free & arm.tells_gain).tolist()
    found = [tried for j in held for tried in _other_gains(arm, start, (j,), columns, ONE_OTHER_GAIN)]
    return sorted(found, key=lambda tried: tried.balance.error)


def _other_gains(
    arm: ArmBalance, start: SetUp, joints: tuple[int, ...], columns: FloatArray, least: float = OTHER_GAIN
) -> Iterator[Tried]:
    """The fit with the drive gains of these joints free, where they are further than `least` from the declared ones."""
    free = start.free.copy()
    free[list(joints)] = True
    set_up = replace(start, free=free)
    tried = Tried(Change("drive_gain", joints, set_up), arm.fit(set_up, columns))
    factors = (tried.balance.gain / arm.gain)[list(joints)]
    if (factors > 0.0).all() and np.abs(np.log(factors)).max() > np.log(least):
        yield tried


def _flip(n: int, joint: int) -> FloatArray:
    return np.where(np.arange(n) == joint, -1.0, 1.0)


def _reversed(arm: ArmBalance, start: SetUp) -> Iterator[Tried]:
    """Reversed joints, one or two at once: the logs of an arm whose axes are parallel may first blame a third one."""
    n = start.zero.size
    for joints in (*((j,) for j in range(n)), *combinations(range(n), 2)):
        flip = np.prod([_flip(n, j) for j in joints], axis=0)
        turned = replace(start, turned=start.turned * flip, zero=start.zero * flip)
        columns = arm.columns(turned)
        both = replace(turned, effort=start.effort * flip)
        yield Tried(Change("joint_reversed", joints, both), arm.fit(both, columns))
        if len(joints) == 1 and arm.own_effort[joints[0]]:
            yield Tried(Change("position_reversed", joints, turned), arm.fit(turned, columns))


def _exchanged(source: IntArray, pair: tuple[int, int]) -> IntArray:
    """The sources (n,) with those of two joints exchanged."""
    other = source.copy()
    other[list(pair)] = other[list(reversed(pair))]
    return other


def _exchanged_columns(arm: ArmBalance, start: SetUp) -> Iterator[Tried]:
    for pair in combinations(range(start.zero.size), 2):
        sources = _exchanged(start.source, pair), _exchanged(start.effort_source, pair)
        set_up = replace(start, source=sources[0], effort_source=sources[1])
        yield Tried(Change("columns_exchanged", pair, set_up), arm.fit(set_up))


def _zeros(arm: ArmBalance, start: SetUp) -> Iterator[Tried]:
    """The best zero of the joint whose zero explains most."""
    angles = np.arange(1, round(2.0 * np.pi / ZERO_STEP)) * ZERO_STEP
    turning = [j for j in range(start.zero.size) if arm.links.tree.revolute[arm.links.order[j]]]
    moved = [(j, replace(start, zero=_moved(start.zero, j, angle))) for j in turning for angle in angles]
    if moved:
        errors = [arm.fit(set_up).error for _, set_up in moved]
        joint, best = moved[int(np.argmin(errors))]
        yield _refined_zero(arm, Change("zero", (joint,), best))


def _moved(zero: FloatArray, joint: int, angle: float) -> FloatArray:
    """The zeros with another one of one joint, within half a turn."""
    moved = zero.copy()
    moved[joint] = (zero[joint] + angle + np.pi) % (2.0 * np.pi) - np.pi
    return moved


def _refined_zero(arm: ArmBalance, change: Change) -> Tried:
    (joint,) = change.joints

    def at(angle: FloatArray) -> SetUp:
        return replace(change.set_up, zero=_moved(change.set_up.zero, joint, float(angle[0])))

    found = minimize(
        lambda angle: arm.fit(at(angle)).error,
        np.zeros(1),
        method="Nelder-Mead",
        options={"maxfev": EVALUATIONS // 2, "initial_simplex": [[0.0], [0.1]], "xatol": 1e-4},
    )
    best = at(found.x)
    return Tried(replace(change, set_up=best), arm.fit(best))


def _gravity(arm: ArmBalance, start: SetUp) -> Tried:
    """The best direction, refined from the best one of `DIRECTIONS` and from the present one.

    Of the coarse directions, the best one for an arm on a slope may be one from which no descent leads to the slope.
    """
    size = float(np.linalg.norm(start.gravity))
    parts = arm.columns_by_gravity(start)

    def fitted(direction: FloatArray) -> tuple[SetUp, Balance]:
        set_up = replace(start, gravity=size * direction / np.linalg.norm(direction))
        return set_up, arm.fit(set_up, parts[0] + np.tensordot(set_up.gravity, parts[1:], axes=1))

    def refined(first: FloatArray) -> tuple[SetUp, Balance]:
        across = np.linalg.svd(first[None, :])[2][1:]
        best = minimize(
            lambda x: fitted(first + x @ across)[1].error,
            np.zeros(2),
            method="Nelder-Mead",
            options={"maxfev": EVALUATIONS, "initial_simplex": [[0.0, 0.0], [0.2, 0.0], [0.0, 0.2]], "xatol": 1e-4},
        )
        return fitted(first + best.x @ across)

    first = min((*DIRECTIONS, start.gravity), key=lambda d: fitted(d)[1].error)
    starts = (first,) if first is start.gravity else (first, start.gravity)
    set_up, balance = min((refined(d / np.linalg.norm(d)) for d in starts), key=lambda found: found[1].error)
    return Tried(Change("gravity", (), set_up), balance)


def payloads(arm: ArmBalance, start: SetUp, groups: Sequence[tuple[str, ...]] | None = None) -> Iterator[Tried]:
    """Something that the outermost link carries in some runs.

    Args:
        arm: Of which the rows are.
        start: The assumption so far.
        groups: Of runs with the same load; None: each single run, and all of them where the links are known.
    """
    if arm.carrier is None:
        return
    columns = arm.columns(start)
    for group in _single_runs(arm, start) if groups is None else groups:
        set_up = replace(start, loaded=(*start.loaded, group))
        balance = arm.fit(set_up, columns)
        if _may_be_carried(balance.loads[-1]):
            yield Tried(Change("payload", (), set_up, group), balance)


def _single_runs(arm: ArmBalance, start: SetUp) -> list[tuple[str, ...]]:
    known = {name for group in start.loaded for name in group}
    runs = list(dict.fromkeys(arm.rows.run.tolist()))
    groups: list[tuple[str, ...]] = [(name,) for name in runs if name not in known] if len(runs) > 1 else []
    return [arm.in_all, *groups] if arm.in_all and not known else groups


def _may_be_carried(load: FloatArray) -> bool:
    """Whether a body can have these ten inertial parameters, its centre within reach."""
    mass, moment = float(load[0]), np.asarray(load[1:4])
    return mass > 0.0 and bool(np.linalg.norm(moment) <= FARTHEST * mass)


def _coupled(arm: ArmBalance, start: SetUp) -> Iterator[Tried]:
    """The pair of joints whose coupling by a gear explains most."""
    n, columns = start.zero.size, arm.columns(start)

    def coupled(pair: tuple[int, int], share: float) -> SetUp | None:
        turns = np.eye(n) if start.turns is None else start.turns.copy()
        turns[pair] += share
        return None if abs(np.linalg.det(turns)) < LEAST_TURN else replace(start, turns=turns)

    def error(pair: tuple[int, int], share: float) -> float:
        set_up = coupled(pair, share)
        return NO_GEAR if set_up is None else arm.fit(set_up, columns).error

    near = [(i, j) for i in range(n) for j in range(n) if 0 < abs(i - j) <= NEIGHBOURS and arm.own_effort[[i, j]].all()]
    if not near:
        return
    _, pair, first = min((error(pair, share), pair, share) for pair in near for share in TURNS)
    best = minimize(
        lambda share: error(pair, float(share[0])),
        np.array([first]),
        method="Nelder-Mead",
        options={"maxfev": EVALUATIONS // 2, "initial_simplex": [[first], [1.3 * first]], "xatol": 1e-4},
    )
    set_up = coupled(pair, float(best.x[0]))
    if set_up is not None:
        yield Tried(Change("coupled", pair, set_up), arm.fit(set_up, columns))
