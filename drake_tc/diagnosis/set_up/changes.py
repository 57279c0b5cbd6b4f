"""Changes of an assumption on an arm's set-up by one thing that is often wrong.

A change says what it is, so that a report can say what to change in the rig or robot file.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.optimize import minimize

from drake_tc.diagnosis.result.set_up import SET_UP_ERRORS, SetUpErrorKind
from drake_tc.diagnosis.set_up.balance import ArmBalance, Balance, SetUp
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
NEIGHBOURS = 2
"""How many joints a gear that couples two of them may lie apart, counted along the arm."""
TURNS = (-1.0, -0.3, 0.3, 1.0)
"""Of a motor for one turn of another joint, before the best one is refined: a bevel gear at a wrist gives 1."""
EVALUATIONS = 60
"""Of a refinement, at most."""


@dataclass(frozen=True, eq=False)
class Change:
    """One change.

    Attributes:
        kind: What.
        joints: (k,) places of the joints that it concerns; empty for gravity.
        set_up: The assumption with it.
    """

    kind: SetUpErrorKind
    joints: tuple[int, ...]
    set_up: SetUp


@dataclass(frozen=True, eq=False)
class Tried:
    """A change and how well it fits."""

    change: Change
    balance: Balance


def tried_changes(arm: ArmBalance, start: SetUp) -> list[Tried]:
    """Every change of one thing, fitted."""
    found = [*_efforts(arm, start), *_reversed(arm, start), *_exchanged_columns(arm, start), *_zeros(arm, start)]
    found += [_gravity(arm, start), *_coupled(arm, start)]
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
    found = [tried for j in held for tried in _other_gains(arm, start, (j,), columns)]
    return sorted(found, key=lambda tried: tried.balance.error)


def _other_gains(arm: ArmBalance, start: SetUp, joints: tuple[int, ...], columns: FloatArray) -> Iterator[Tried]:
    """The fit with the drive gains of these joints free, where they are far from the declared ones."""
    free = start.free.copy()
    free[list(joints)] = True
    set_up = replace(start, free=free)
    tried = Tried(Change("drive_gain", joints, set_up), arm.fit(set_up, columns))
    factors = (tried.balance.gain / arm.gain)[list(joints)]
    if (factors > 0.0).all() and np.abs(np.log(factors)).max() > np.log(OTHER_GAIN):
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


def _coupled(arm: ArmBalance, start: SetUp) -> Iterator[Tried]:
    """The pair of joints whose coupling by a gear explains most."""
    n, columns = start.zero.size, arm.columns(start)

    def fitted(pair: tuple[int, int], share: float) -> tuple[SetUp, Balance]:
        turns = np.eye(n) if start.turns is None else start.turns.copy()
        turns[pair] += share
        set_up = replace(start, turns=turns)
        return set_up, arm.fit(set_up, columns)

    near = [(i, j) for i in range(n) for j in range(n) if 0 < abs(i - j) <= NEIGHBOURS and arm.own_effort[[i, j]].all()]
    if not near:
        return
    tried = [(fitted(pair, share)[1].error, pair, share) for pair in near for share in TURNS]
    _, pair, first = min(tried)
    best = minimize(
        lambda share: fitted(pair, float(share[0]))[1].error,
        np.array([first]),
        method="Nelder-Mead",
        options={"maxfev": EVALUATIONS // 2, "initial_simplex": [[first], [1.3 * first]], "xatol": 1e-4},
    )
    set_up, balance = fitted(pair, float(best.x[0]))
    yield Tried(Change("coupled", pair, set_up), balance)
