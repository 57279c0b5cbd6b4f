"""Wrong signs: a torque, command or position column that runs against what the joint's balance demands.

In the balance  y = (tau + J qddot + f_v qdot + f_c sign(qdot)) / K  every coefficient is positive (K > 0, friction
takes power). The effort is regressed on all of them; what is left of the load torque's share (its partial correlation
with the effort) tells the sign. A turned command turns every coefficient, a turned torque only the load's, a turned
position all but the load's. Two turned columns of three are told as the third: the model is the same.

An effort that is recorded without its sign: |y| in place of y.

Some drives report the amplitude of the current. The balance  y = (tau + J qddot + f_v qdot + f_c sign(qdot)) / K + c
then holds for s y, s = 1 or -1, and nowhere for y where the joint needs efforts of both signs. The signs s are those of
the balance itself: they are first those of the load and then of the fit to s y, until they no longer change.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.errors import LogError
from drake_tc.logs.checks.plausible import derivative
from drake_tc.logs.loads import Pendulum, RobotLoad, unknown_form
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray, IntArray

CLEAR = 0.5
TELLING = 0.04
TURNED = 0.15
"""Share of friction and of inertia, both negative, of a position of the wrong sign; a delay makes only one so."""
MAX_ROWS = 60_000


@dataclass(frozen=True)
class SignEvidence:
    """What one run says of one joint's signs.

    Attributes:
        load: Partial correlation of the effort with the load torque, in [-1, 1].
        friction: Share of the effort that goes with the velocity as friction does, in [-1, 1]; negative feeds power.
        inertia: Partial correlation of the effort with the acceleration, in [-1, 1].
        following: Correlation of command and position (position servo), 0 for other drives.
        gain: Least and largest effort for 1 N m of load torque, of the whole run and of its thirds.
        weight: Usable samples.
        steady: Whether each third of the run agrees with the sign of `load`.
    """

    load: float
    friction: float
    inertia: float
    following: float
    gain: tuple[float, float]
    weight: int
    steady: bool


def _partial(y: FloatArray, x: FloatArray, others: FloatArray) -> float:
    """Correlation of y and x (T,) after the columns of `others` (T, k) are taken out of both."""
    scale = np.linalg.norm(others, axis=0)
    basis = others / np.where(scale > 0, scale, 1.0)
    both = np.column_stack([y, x])
    rest = both - basis @ np.linalg.lstsq(basis, both, rcond=None)[0]
    norms = np.linalg.norm(rest, axis=0)
    small = norms <= 1e-9 * np.linalg.norm(both, axis=0)
    return 0.0 if small.any() else float(rest[:, 0] @ rest[:, 1] / norms.prod())


def effort_and_motion(run: Run, rig: Rig, joint: str, rows: IntArray) -> tuple[FloatArray, FloatArray]:
    """Effort y (N,) of some rows, and (N, 4) what else is in its balance but the load: qddot, qdot, sign(qdot), 1.

    The sign is smoothed over a fifth of the upper quartile of the speed.
    """
    q, command = run.columns[f"{joint}/position"], run.columns[rig.command_column(joint)]
    qd, qdd = derivative(q, run.period)[rows], derivative(q, run.period, 2)[rows]
    effort = (command - q if rig.drive[joint] == "position_servo" else command)[rows]
    resolved = float(np.percentile(np.abs(qd), 75)) * 0.2 + 1e-9
    return effort, np.column_stack([qdd, qd, np.tanh(qd / resolved), np.ones(rows.size)])


def balance_of(run: Run, rig: Rig, joint: str) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Effort (N,), load torque (N,) and `effort_and_motion`'s other columns (N, 4) of the usable rows.

    None where the load is not known before a fit, where fewer than 50 rows are usable, or where load or effort is
    constant.
    """
    load, usable = rig.load[joint], np.flatnonzero(run.segment >= 0)
    pick = usable[:: max(1, usable.size // MAX_ROWS)]
    if unknown_form(load) is not None or isinstance(load, RobotLoad) or pick.size < 50:
        return None
    y, others = effort_and_motion(run, rig, joint, pick)
    if isinstance(load, Pendulum):
        tau = load.in_run(run).torque(run.columns[f"{joint}/position"][pick], np.zeros(pick.size))
    else:
        tau = run.columns[f"{joint}/torque"][pick]
    return None if np.ptp(tau) == 0.0 or np.ptp(y) == 0.0 else (y, tau, others)


def sign_evidence(run: Run, rig: Rig, joint: str) -> SignEvidence | None:
    """Regress the effort on load torque, acceleration, velocity and its sign; None where there is nothing to go by."""
    balance = balance_of(run, rig, joint)
    if balance is None:
        return None
    y, tau, others = balance
    qdd, qd = others[:, 0], others[:, 1]
    correlation = _partial(y, tau, others)
    parts = np.array_split(np.arange(y.size), 3)
    thirds = [_partial(y[part], tau[part], others[part]) for part in parts]
    columns = np.column_stack([others, tau])
    coefficients = np.linalg.lstsq(columns, y, rcond=None)[0]
    gains = [coefficients[4], *(np.linalg.lstsq(columns[part], y[part], rcond=None)[0][4] for part in parts)]
    drag = others[:, 1:3] @ coefficients[1:3]
    power = np.linalg.norm(y - y.mean()) * np.linalg.norm(qd)
    friction = float(np.clip(drag @ qd / power, -1.0, 1.0)) if power > 0 else 0.0
    following = _following(run, rig, joint) if rig.drive[joint] == "position_servo" else 0.0
    steady = all(np.sign(third) == np.sign(correlation) for third in thirds)
    inertia = _partial(y, qdd, np.column_stack([others[:, 1:], tau]))
    gain = float(min(gains)), float(max(gains))
    return SignEvidence(correlation, friction, inertia, following, gain, int(y.size), steady)


def _following(run: Run, rig: Rig, joint: str) -> float:
    """Correlation of a servo's command and position over the usable rows; 0 where one of them rests."""
    usable = run.segment >= 0
    command, q = (run.columns[name][usable] for name in (rig.command_column(joint), f"{joint}/position"))
    return float(np.corrcoef(command, q)[0, 1]) if min(np.ptp(q), np.ptp(command)) > 0 else 0.0


def _verdict(evidence: SignEvidence, load: object, *, servo: bool) -> str:
    """Which channel is turned: "command", "torque", "either" of them, "" (none) or "?" (not clear)."""
    if servo and evidence.following < -0.9:
        return "command"
    if abs(evidence.load) < CLEAR or not evidence.steady:
        return "?"
    if evidence.load > 0:
        return ""
    if isinstance(load, Pendulum):
        return "?" if servo else "command"
    return "torque" if servo else "either"


def _torque_or_command(turned: Sequence[SignEvidence]) -> tuple[str, str]:
    """Which of torque and command is turned, over all turned runs together, and the doubt left, in words.

    Friction must take power; where its share of the effort is too small to tell, the torque is blamed, whose sign is
    a matter of convention.
    """
    weight = sum(e.weight for e in turned)
    share = sum(e.friction * e.weight for e in turned) / weight if weight else 0.0
    if abs(share) < TELLING:
        return "torque", " (friction is too small to tell whether the command is the wrong one instead)"
    return ("command" if share < 0 else "torque"), ""


def wrong_signs(runs: Sequence[Run], rig: Rig) -> Sequence[Mapping[str, str]]:
    """For each run, the channels to be turned: canonical name to the reason, in words.

    A run that is clear decides for itself; one that is not follows the others of the same rig. Which of torque and
    current (or voltage) has the wrong sign is decided from all such runs together: friction must dissipate power.
    """
    _require_friction(runs, rig)
    flips: list[dict[str, str]] = [{} for _ in runs]
    for joint in rig.joints:
        servo = rig.drive[joint] == "position_servo"
        found = [sign_evidence(run, rig, joint) for run in runs]
        verdicts = [_told(run, evidence, rig, joint) for run, evidence in zip(runs, found, strict=True)]
        which, doubt = _torque_or_command([e for e in found if e is not None and e.load < 0])
        verdicts = [which if verdict == "either" else verdict for verdict in verdicts]
        clear = [verdict for verdict in verdicts if verdict != "?"]
        common = max(set(clear), key=clear.count) if clear else ""
        for run, flip, evidence, verdict in zip(runs, flips, found, verdicts, strict=True):
            turned = common if verdict == "?" else verdict
            if not turned:
                continue
            if verdict == "?" or evidence is None:
                reason = "as in the other runs of this rig"
            elif turned in ("command", "position") and servo:
                reason = f"its correlation with the {'position' if turned == 'command' else 'command'} is"
                reason += f" {evidence.following:.2f}"
            else:
                reason = f"partial correlation of effort and load torque {evidence.load:.2f}, which should be positive"
                reason += "" if servo or isinstance(rig.load[joint], Pendulum) else doubt
            flip |= dict.fromkeys(_columns(turned, run, rig, joint), reason)
    return flips


def _require_friction(runs: Sequence[Run], rig: Rig) -> None:
    """Refuse a current's or voltage's run in which the load is right and all that the position makes is turned.

    The position has the wrong sign then, or effort and torque are exchanged, which gives another model.

    Raises:
        LogError: names file, column and both ways out.
    """
    for joint in (joint for joint in rig.joints if rig.drive[joint] != "position_servo"):
        for run in runs:
            e = sign_evidence(run, rig, joint)
            turned = e is not None and max(e.friction, e.inertia) < -TURNED and abs(e.load) > CLEAR and e.steady
            if e is None or not turned or e.load < 0.0:
                continue
            names = (f"{joint}/position", rig.command_column(joint), f"{joint}/torque")
            entry = f"{names[0]}: {rig.opposite_unit(names[0], rig.units_of(joint).position)}"
            position, command, torque = (repr(rig.columns.get(name, name)) for name in names)
            raise LogError(
                f"{run.source or run.name}: friction and inertia of {joint} would drive it: column {position} has the"
                f" wrong sign, or {command} and {torque} are exchanged; set units: {{{entry}}}, or exchange"
                " them under `columns:` in the rig file"
            )


def _told(run: Run, evidence: SignEvidence | None, rig: Rig, joint: str) -> str:
    """The verdict on one run; of a servo whose angles run against each other, the one that the load torque blames."""
    if evidence is None:
        return "?"
    servo, load = rig.drive[joint] == "position_servo", rig.load[joint]
    verdict = _verdict(evidence, load, servo=servo)
    if verdict != "command" or not servo or isinstance(load, Pendulum):
        return verdict
    command = rig.command_column(joint)
    turned = sign_evidence(replace(run, columns={**run.columns, command: -run.columns[command]}), rig, joint)
    return "position" if turned is not None and turned.load < -CLEAR and turned.steady else "command"


def _columns(turned: str, run: Run, rig: Rig, joint: str) -> list[str]:
    """The channels that have the sign of a turned one; velocity and motor position are those of the position."""
    if turned == "command":
        return [rig.command_column(joint)]
    suffixes = ("torque",) if turned == "torque" else ("position", "velocity", "motor_position")
    return [name for name in (f"{joint}/{suffix}" for suffix in suffixes) if name in run.columns]


BELOW_ZERO = 0.01
"""Least effort over the largest one, below 0, of an effort that has a sign."""
BOTH_SIGNS = 0.1
"""Share of the samples in which the balance must ask for either sign."""
LEAST_LEFT = 0.2
"""Share of the effort's standard deviation that the balance must leave of it as it is recorded."""
MUCH_BETTER = 0.5
"""Share of that error which may be left at most of the effort with the signs of the balance."""
ROUNDS = 10


def refuse_unsigned(runs: Sequence[Run], rig: Rig) -> None:
    """Refuse runs whose current, voltage or commanded torque is an absolute value.

    Raises:
        LogError: names file and column.
    """
    for joint in (joint for joint in rig.joints if rig.drive[joint] != "position_servo"):
        for run in runs:
            balance = balance_of(run, rig, joint)
            if balance is not None and is_unsigned(*balance):
                name = rig.command_column(joint)
                raise LogError(
                    f"{run.source or run.name}: column {rig.columns.get(name, name)!r} of {joint} seems to be an "
                    "absolute value: it is never negative, and load and motion need efforts of both signs; record it "
                    "with its sign"
                )


def is_unsigned(effort: FloatArray, load: FloatArray, others: FloatArray) -> bool:
    """Whether an effort (N,) of one sign fits the balance only with the signs that the balance asks for.

    Args:
        effort: (N,) as recorded.
        load: (N,) load torque [N m].
        others: (N, k) what else is in the balance.
    """
    if effort.min() < -BELOW_ZERO * effort.max():
        return False
    columns = np.column_stack([load, others])
    as_it_is = effort - columns @ np.linalg.lstsq(columns, effort, rcond=None)[0]
    sign = np.where(load < 0.0, -1.0, 1.0)
    for _ in range(ROUNDS):
        fitted = columns @ np.linalg.lstsq(columns, sign * effort, rcond=None)[0]
        before, sign = sign, np.where(fitted < 0.0, -1.0, 1.0)
        if np.array_equal(before, sign):
            break
    left = float(np.std(as_it_is))
    share = float(np.mean(sign < 0.0))
    return bool(
        min(share, 1.0 - share) >= BOTH_SIGNS
        and left > LEAST_LEFT * np.std(effort)
        and np.std(sign * effort - fitted) <= MUCH_BETTER * left
    )
