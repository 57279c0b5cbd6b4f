"""Position and command of a servo that are exchanged: what must speak for it before a log is refused.

A servo's position follows its command, the command has no sensor noise, and friction takes power. With the columns
exchanged the "position" leads, the "command" is the noisy one, and the effort  command - position  turns round, and
with it every coefficient of the balance (`signs`).
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.errors import LogError
from drake_tc.logs.channels import run_lengths
from drake_tc.logs.plausible import derivative
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.logs.signs import TELLING, sign_evidence
from drake_tc.types import FloatArray

LEAD = 0.5
"""Samples by which the position leads the command, to count."""
NOISIER = 4.0
"""Times that the command is noisier than the position, to count."""
LONGEST_LAG = 100
"""Samples that are looked at on each side."""
LONGEST_USED = 60_000
"""Samples from which the lead is computed."""


def refuse_exchanged(runs: Sequence[Run], rig: Rig) -> None:
    """Refuse a servo's runs whose columns of position and command are exchanged.

    Two must say so in most of the runs. Where the load torque is known, one of them is that effort and load torque run
    against each other while friction feeds power. The others: the position leads the command by half a sample or
    more; the command is at least four times as noisy, or alone has an encoder's steps.

    Raises:
        LogError: names file and columns.
    """
    for joint in rig.joints:
        if rig.drive[joint] != "position_servo":
            continue
        said = [(run, _signs(run, rig, joint)) for run in runs if f"{joint}/position" not in run.speed_only]
        turned = [(run, reasons) for run, reasons in said if len(reasons) >= 2]
        if 2 * len(turned) > len(said):
            run, reasons = turned[0]
            q, command = (rig.columns.get(name, name) for name in (f"{joint}/position", f"{joint}/position_command"))
            raise LogError(
                f"{run.source}: the columns {q!r} (position) and {command!r} (position_command) of {joint} seem to be"
                f" exchanged: {' and '.join(reasons)}; exchange them under `columns:` in the rig file"
            )


def _signs(run: Run, rig: Rig, joint: str) -> list[str]:
    """What says that this run's columns are exchanged."""
    names = (f"{joint}/position", f"{joint}/position_command")
    usable = run.segment >= 0
    position, command = (run.columns[name] for name in names)
    reasons = []
    lead = leads_by(position, command, usable.astype(np.float64), run.period)
    if lead > LEAD:
        reasons.append(f"the position leads the command by {1e3 * lead * run.period:.3g} ms")
    noise = [_noise(values[usable], name in run.steps) for values, name in zip((position, command), names, strict=True)]
    if noise[1] > NOISIER * noise[0] or (names[1] in run.steps and names[0] not in run.steps):
        reasons.append("the command has a sensor's noise or steps, and the position has not")
    evidence = sign_evidence(run, rig, joint)
    if evidence is None:
        return reasons
    turned = evidence.steady and evidence.load < 0.0 and evidence.friction < -TELLING
    return [*reasons, "friction would drive the joint"] if turned else []


def leads_by(first: FloatArray, second: FloatArray, weights: FloatArray, period: float) -> float:
    """Samples by which the channel `first` (T,) comes before `second` (T,), negative if after; 0 where nothing tells.

    The maximum over whole samples of the correlation of their rates where both overlap, and between samples that of
    the parabola through three.
    """
    a, b = (derivative(values, period) * weights for values in (first[:LONGEST_USED], second[:LONGEST_USED]))
    reach = min(LONGEST_LAG, a.size // 4)
    if reach < 2 or a.std() == 0.0 or b.std() == 0.0:
        return 0.0
    size = a.size
    score = np.array([_alike(a[max(0, -s) : size - max(0, s)], b[max(0, s) : size + min(0, s)]) for s in _range(reach)])
    best = int(np.argmax(score))
    if not 0 < best < score.size - 1:
        return 0.0
    before, at, after = score[best - 1 : best + 2].tolist()
    bend = before - 2.0 * at + after
    return float(best - reach + (0.5 * (before - after) / bend if bend else 0.0))


def _range(reach: int) -> range:
    return range(-reach, reach + 1)


def _alike(a: FloatArray, b: FloatArray) -> float:
    """Correlation of two stretches (T,); 0 where one is constant."""
    a, b = a - a.mean(), b - b.mean()
    norm = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / norm if norm > 0.0 else 0.0


def _noise(values: FloatArray, has_steps: bool) -> float:
    """Robust level of what changes from row to row: median of fourth differences, as of white noise.

    Values (T,) that repeat although they lie on no grid are held between the messages of a slower topic. They count
    once, because the staircase of a held command is not noise.
    """
    if not has_steps:
        values = values[run_lengths(values)[0]]
    if values.size < 10:
        return 0.0
    return float(np.median(np.abs(np.diff(values, 4))) / np.sqrt(70.0))
