"""The torque balances of all joints of an arm under an assumption on its set-up.

    y_j = K_j Y_j(q, v, vdot; g) (pi_0 + delta) + a_j vdot_j + f_j v_j + c_j sign(v_j) + b_j + e_j

with e_j ~ (0, sigma_j^2). Y is the regressor of the links' parameters (`robot.rigid_regressor`), pi_0 those of the
robot's file and delta ~ N(0, t^2) by the rig's tolerance. What the outermost link carries in some runs has ten
more, about 0 with the standard deviations of `payload_deviations`. a_j, f_j and c_j are not negative: inertia is
positive and friction dissipates. b_j may have any sign. The drive gain K_j is the declared one, or the best one of
K_j >= 0. The fit minimises

    sum_j N_j log sigma_j^2 + |delta/t|^2/s                          s = `INDEPENDENT`, by reweighted least squares.

The assumption says which way each joint turns, where its zero is, whose columns it has, and where gravity acts. The
models of the joints' own search tell more of each joint; this one is fitted in a tenth of a second, so that a hundred
assumptions can be compared.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from drake_tc.estimation.robot_loads import RobotLogs, filters_of, motor_loads, usable_stretches
from drake_tc.filtering.savitzky_golay import smooth
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.robot.rigid_regressor import LINK_PARAMETERS, LinkModel
from drake_tc.types import BoolArray, FloatArray, IntArray

MOST_ROWS = 600
"""Of all runs together: errors that are looked for are far larger than the noise."""
STRETCH = 10
"""Rows of a part that follow each other."""
LOAD = len(LINK_PARAMETERS)
"""Inertial parameters of what a link carries."""
OWN = 5
"""Columns of a joint's own: acceleration, velocity and its sign, 1 and -1."""
INDEPENDENT = 0.1
"""Share of the rows that say something of their own."""
ROUNDS = 4
"""Of reweighting the joints, and of Gauss-Newton where a drive gain is free."""
LEAST_NOISE = 1e-3
"""Of a joint's effort: no joint weighs more than this lets it."""
MOVES = 0.1
"""Speed from which a joint counts as sliding, as a share of its own 90th percentile."""
STILL = 0.005
"""Speed up to which no joint counts as sliding, as a share of the fastest joint's 90th percentile."""
NO_LOAD = 1e-6
"""Load by the robot's file, as a share of what its tolerance allows, below which it tells nothing."""
LEAST_ROWS = 50
"""Of a joint whose balance takes part."""


@dataclass(frozen=True, eq=False)
class SetUpRows:
    """All joints at T instants, in the order of the robot's joints, by the filters of the loads.

    Attributes:
        position, velocity, acceleration: (T, n) of the joints [rad or m], as recorded.
        effort: (T, n) in the unit of each drive; 0 of joints that are not the rig's.
        run: (T,) name of the run.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    effort: FloatArray
    run: NDArray[np.str_]

    def before(self, others: "SetUpRows") -> "SetUpRows":
        """These rows, and others after them."""
        names = [field.name for field in fields(self)]
        return SetUpRows(*(np.concatenate([getattr(each, name) for each in (self, others)]) for name in names))

    def part(self, number: int, parts: int) -> "SetUpRows":
        """One of so many parts of these rows: stretches of `STRETCH` rows, dealt in turn."""
        mine = (np.arange(len(self.run)) // STRETCH) % parts == number
        return SetUpRows(*(getattr(self, field.name)[mine] for field in fields(self)))


def set_up_rows(logs: RobotLogs, runs: Sequence[Run], rig: Rig) -> SetUpRows:
    """The rows of these runs, evenly spaced in time, without the ends of the filters' windows."""
    parts = [(run.name, part) for run in runs for part in _stretches(logs, run, rig)]
    step = max(1, sum(len(part) for _, part in parts) // MOST_ROWS)
    every = np.concatenate([part[::step] for _, part in parts])
    names = np.concatenate([np.full(len(part[::step]), name) for name, part in parts])
    position, velocity, acceleration, effort = np.moveaxis(every, 1, 0)
    return SetUpRows(position, velocity, acceleration, effort, names)


def _stretches(logs: RobotLogs, run: Run, rig: Rig) -> list[FloatArray]:
    """Of each usable stretch (T, 4, n): position, velocity, acceleration and effort."""
    filters = filters_of(logs, run)
    window, edge = filters.encoder, filters.longest // 2
    found = []
    for part in usable_stretches(run, filters):
        motion = smooth(logs.sensors(run, part).position, window.samples, window.order, run.period)
        effort = np.column_stack([_effort(run, rig, joint)[part] for joint in logs.robot.joints])
        felt = smooth(effort, window.samples, window.order, run.period).value
        every = np.stack([motion.value, motion.first_derivative, motion.second_derivative, felt], axis=1)
        found.append(every[edge : len(every) - edge])
    return found


def _effort(run: Run, rig: Rig, joint: str) -> FloatArray:
    if joint not in rig.joints:
        return np.zeros(len(run))
    command = run.columns[rig.command_column(joint)]
    return command - run.columns[f"{joint}/position"] if rig.drive[joint] == "position_servo" else command


@dataclass(frozen=True, eq=False)
class SetUp:
    """One assumption. All arrays are in the order of the robot's joints.

    Attributes:
        source: (n,) joint whose motion each joint has. effort_source: (n,) joint whose effort it has.
        turned: (n,) sign of the recorded positions. effort: (n,) sign of the recorded efforts.
        zero: (n,) reading of the joint at the zero of the robot's file [rad or m], after the sign.
        gravity: (3,) of the base [m/s^2].
        free: (n,) whether the drive gain is fitted.
        turns: (n, n) of the motors where gears couple joints (`estimation.robot_loads`); None where none does.
        loaded: Names of runs in which the outermost link carries something, those with the same load together.
    """

    source: IntArray
    effort_source: IntArray
    turned: FloatArray
    effort: FloatArray
    zero: FloatArray
    gravity: FloatArray
    free: BoolArray
    turns: FloatArray | None = None
    loaded: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True, eq=False)
class Balance:
    """A fit.

    Attributes:
        share: (n,) RMS of what is left over that of the effort; NaN of joints that hardly move.
        gain: (n,) K [effort/(N m)], declared or fitted.
        departure: |delta/t|^2, how far the links are from those of the robot's file.
        loads: (m, 10) inertial parameters of what is carried in each group of loaded runs.
    """

    share: FloatArray
    gain: FloatArray
    departure: float
    loads: FloatArray

    @property
    def error(self) -> float:
        """Mean logarithm of the joints' shares."""
        return float(np.nanmean(np.log(self.share)))


@dataclass(frozen=True, eq=False)
class ArmBalance:
    """An arm and its rows, ready for any assumption.

    Attributes:
        links: Of the robot's file.
        rows: Of some runs.
        tolerance: (10 n,) t.
        gain: (n,) declared K; NaN where none is.
        own_effort: (n,) whether the effort is a column of its own; not so for a servo, whose effort is the difference
            of command and position.
        turns: Those of the rig file.
        carrier: Number of the link that may carry something; None where several links are outermost.
        loaded: Groups of runs that the rig file says to be loaded.
        in_all: Names of all runs where the links are taken as known, so that something may be carried in all of them;
            links that are fitted take it up.
    """

    links: LinkModel
    rows: SetUpRows
    tolerance: FloatArray
    gain: FloatArray
    own_effort: BoolArray
    turns: FloatArray | None = None
    carrier: int | None = None
    loaded: tuple[tuple[str, ...], ...] = ()
    in_all: tuple[str, ...] = ()

    @property
    def as_declared(self) -> SetUp:
        """What robot and rig file say."""
        n = self.gain.size
        return SetUp(
            source=np.arange(n),
            effort_source=np.arange(n),
            turned=np.ones(n),
            effort=np.ones(n),
            zero=np.zeros(n),
            gravity=self.links.tree.gravity,
            free=np.isnan(self.gain),
            turns=self.turns,
            loaded=self.loaded,
        )

    @cached_property
    def tells_gain(self) -> BoolArray:
        """(n,) whether the robot's file gives the joint a load: without one, the logs tell no drive gain."""
        columns = self.columns(self.as_declared)
        if self.turns is not None:
            columns = motor_loads(self.turns, columns)
        load, spread = (np.abs(columns * pi).max(axis=(0, 2)) for pi in (self.links.nominal, self.tolerance))
        return np.asarray(load > NO_LOAD * spread)

    def columns(self, set_up: SetUp) -> FloatArray:
        """Y (T, n, 10 n) of the joints' motion under one assumption."""
        q = set_up.turned * self.rows.position[:, set_up.source] - set_up.zero
        v, a = (set_up.turned * x[:, set_up.source] for x in (self.rows.velocity, self.rows.acceleration))
        return self._regressor(q, v, a, set_up.gravity)

    def columns_by_gravity(self, set_up: SetUp) -> FloatArray:
        """(4, T, n, 10 n): what `columns` are without gravity, and by how much 1 m/s^2 of it along each axis adds."""
        weightless = self.columns(replace(set_up, gravity=np.zeros(3)))
        q = set_up.turned * self.rows.position[:, set_up.source] - set_up.zero
        return np.stack([weightless, *(self._regressor(q, 0.0 * q, 0.0 * q, axis) for axis in np.eye(3))])

    def _regressor(self, q: FloatArray, v: FloatArray, a: FloatArray, gravity: FloatArray) -> FloatArray:
        links = replace(self.links, tree=replace(self.links.tree, gravity=gravity))
        return links.columns(q, v, a)

    def fit(self, set_up: SetUp, columns: FloatArray | None = None) -> Balance:
        """All joints under one assumption; `columns` are those of the motion where they are known."""
        columns = self.columns(set_up) if columns is None else columns
        groups, zero = len(set_up.loaded), np.zeros(LOAD)
        grams = self._grams(set_up, np.concatenate([columns, *self._carried(set_up, columns)], axis=2))
        nominal = np.concatenate([self.links.nominal, *[zero] * groups])
        tolerance = np.concatenate([self.tolerance, *[self.links.payload_deviations] * groups])
        declared = np.where(set_up.free, np.nan, self.gain)
        return _fit(grams, nominal, tolerance, declared, 1.0 / (INDEPENDENT * len(self.rows.effort)), groups)

    def _carried(self, set_up: SetUp, columns: FloatArray) -> list[FloatArray]:
        """(T, n, 10) of the load of each group, from those of the link that carries it; 0 in other runs."""
        if self.carrier is None:
            return []
        own = columns[:, :, LOAD * self.carrier : LOAD * (self.carrier + 1)]
        return [own * np.isin(self.rows.run, group)[:, None, None] for group in set_up.loaded]

    def _grams(self, set_up: SetUp, columns: FloatArray) -> list[FloatArray | None]:
        """By joint, the mean of [Y_j, vdot, v, sign v, 1, -1, y]' [...] over the rows in which it slides.

        None of joints that hardly slide.
        """
        v, a = (set_up.turned * x[:, set_up.source] for x in (self.rows.velocity, self.rows.acceleration))
        y = set_up.effort * self.rows.effort[:, set_up.effort_source]
        if set_up.turns is not None:
            columns, v, a = motor_loads(set_up.turns, columns), v @ set_up.turns.T, a @ set_up.turns.T
        grams: list[FloatArray | None] = []
        fast = np.percentile(np.abs(v), 90, axis=0)
        for j in range(y.shape[1]):
            slides = np.abs(v[:, j]) > max(MOVES * fast[j], STILL * fast.max(), 1e-9)
            one = np.ones(len(v))
            own = np.column_stack([a[:, j], v[:, j], np.sign(v[:, j]), one, -one, y[:, j]])
            every = np.column_stack([columns[:, j], own])[slides]
            known = len(every) >= LEAST_ROWS and np.any(every[:, -1])
            grams.append(every.T @ every / len(every) if known else None)
        return grams


def _fit(
    grams: Sequence[FloatArray | None],
    nominal: FloatArray,
    tolerance: FloatArray,
    declared: FloatArray,
    prior: float,
    groups: int,
) -> Balance:
    """`groups` of loaded runs have the last parameters, `LOAD` each."""
    n = len(grams)
    size = np.array([np.nan if g is None else np.sqrt(g[-1, -1]) for g in grams])
    delta, gain, sigma = np.zeros(nominal.size), np.empty(n), size.copy()
    for number in range(ROUNDS):
        for j, gram in enumerate(grams):
            gain[j], sigma[j] = _joint(gram, nominal + delta, declared[j])
        sigma = np.maximum(sigma, LEAST_NOISE * size)
        if number < ROUNDS - 1:
            known = [(g, gain[j], sigma[j], np.isnan(declared[j])) for j, g in enumerate(grams) if g is not None]
            delta = _links(known, nominal, tolerance, prior, nominal + delta)
    loads = delta[delta.size - LOAD * groups :].reshape(groups, LOAD)
    return Balance(sigma / size, gain, float(np.sum((delta / tolerance) ** 2)), loads)


def _joint(gram: FloatArray | None, pi: FloatArray, declared: float) -> tuple[float, float]:
    """One joint's drive gain and RMS of what is left, for given links."""
    if gram is None:
        return float("nan"), float("nan")
    k = pi.size
    mix = np.zeros((gram.shape[0], OWN + 2))
    mix[:k, 0], mix[k:, 1:] = pi, np.eye(OWN + 1)
    small = mix.T @ gram @ mix  # of [load, vdot, v, sign v, 1, -1, y]
    left = np.zeros(OWN + 2)
    parts = float(np.diag(gram)[:k] @ pi**2)
    if np.isnan(declared) and small[0, 0] <= NO_LOAD**2 * parts:
        declared = 0.0
    if np.isnan(declared):
        left[: OWN + 1] = _not_negative(small[:-1, :-1], small[:-1, -1])
    else:
        left[0] = declared
        towards = small[1:-1, -1] - declared * small[1:-1, 0]
        left[1 : OWN + 1] = _not_negative(small[1:-1, 1:-1], towards)
    left[-1] = -1.0
    return float(left[0]), math.sqrt(max(float(left @ small @ left), 0.0))


def _not_negative(gram: FloatArray, towards: FloatArray) -> FloatArray:
    """Least squares x >= 0 of normal equations."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
    values, vectors = np.linalg.eigh(gram * np.outer(scale, scale))
    root = np.sqrt(np.maximum(values, 1e-12))
    solution, _ = nnls(root[:, None] * vectors.T, (vectors.T @ (scale * towards)) / root)
    return np.asarray(scale * solution)


def _links(
    joints: Sequence[tuple[FloatArray, float, float, bool]],
    nominal: FloatArray,
    tolerance: FloatArray,
    prior: float,
    links: FloatArray,
) -> FloatArray:
    """Delta (10 n,) beside the joints' own coefficients, which stay free but of the sign that they may have.

    K (pi_0 + delta) is not linear where K is free. Its change dK is then one unknown more, with the load by the present
    links as its column (Gauss-Newton): in turn alone, gain and links converge in tens of rounds.

    Args:
        joints: Gram matrix, drive gain, noise, and whether the gain is free, of each.
        nominal: pi_0.
        tolerance: t.
        prior: 1/s per row.
        links: (10 n,) parameters of the last round.
    """
    p, n = nominal.size, len(joints)
    total = p + n + OWN * n
    left, right = np.zeros((total, total)), np.zeros(total)
    left[:p, :p] = prior * np.eye(p)
    for number, (gram, gain, sigma, is_free) in enumerate(joints):
        place = np.concatenate([np.arange(p), [p + number], p + n + OWN * number + np.arange(OWN)])
        mix = np.zeros((gram.shape[0], place.size + 1))
        mix[:p, :p] = gain * np.diag(tolerance)
        mix[:p, p] = gain * links * is_free
        mix[p:, p + 1 :] = np.eye(OWN + 1)
        mix[:p, -1] = -gain * nominal
        small = mix.T @ gram @ mix / sigma**2
        left[np.ix_(place, place)] += small[:-1, :-1]
        right[place] += small[:-1, -1]
    free = np.ones(total, dtype=np.bool_)
    while True:
        x = np.zeros(total)
        x[free] = np.linalg.lstsq(left[np.ix_(free, free)], right[free], rcond=1e-12)[0]
        wrong = (x < 0.0) & free & (np.arange(total) >= p + n)
        if not wrong.any():
            return np.asarray(tolerance * x[:p])
        free &= ~wrong
