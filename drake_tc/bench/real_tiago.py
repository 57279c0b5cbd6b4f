"""`bench real-tiago`: what dominates the wrist's currents of a service robot's arm.

Joints 6 and 7 are a differential: two motors turn with q6 + q7 and q6 - q7. Their current is reported as exactly zero
most of the time that the joints move, which no function of speed, acceleration and direction gives: a dead zone of the
report. Whether a motor's report is open, g in {0, 1}, is taken from the report itself, so the gated friction

    y = g (F_c sign(qdot) + F_v qdot + b)

says how much of the linear model's residual the dead zone explains, and not when it opens.
"""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from drake_tc.bench.real_arm import set_folder
from drake_tc.bench.real_rows import RealRow
from drake_tc.diagnosis.problem.arm.shafts import Axis, joint_axes, motor_axes
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.logs.importers.tiago import convert
from drake_tc.logs.readers import read_table
from drake_tc.types import BoolArray, FloatArray

DATA_SET = "tiago-arm"
JOINTS = ("arm_5_joint", "arm_6_joint", "arm_7_joint")
MOTOR_TURNS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0, -1.0]])
MOTORS = ("motor_5", "motor_6+7", "motor_6-7")
TORQUE_PER_AMPERE = -0.0613 * 336.0
WIDTH = 0.14
"""Of the kernel that everything passes twice [s]: together as narrow as the published 200 ms filter."""
MOVING = (9.0, 68.0)
"""When the arm moves [s]."""
PERIOD = 0.01
STRETCH, FOLDS = 2.0, 5
"""Every fifth two seconds are held out, in turn."""
OPEN = 5e-4
"""Half a step of the reported current [A]."""

Progress = Callable[[str, float], None]


def wrist_of(data: Path) -> tuple[FloatArray, FloatArray]:
    """Positions (T, 3) [rad] and reported currents (T, 3) [A] of the wrist on a uniform clock.

    Raises:
        LogError: the set is not in `data`.
    """
    with TemporaryDirectory() as scratch:
        convert(set_folder(data, DATA_SET), Path(scratch))
        table = read_table(Path(scratch) / "identification.parquet")
    grid = np.arange(*MOVING, PERIOD)
    time = table["time"].to_numpy(float)
    nearest = np.minimum(np.searchsorted(time, grid), time.size - 1)
    position = [np.interp(grid, time, table[f"{j}/position"].to_numpy(float)) for j in JOINTS]
    current = [table[f"{j}/current"].to_numpy(float)[nearest] for j in JOINTS]  # as reported: no new values between
    return np.column_stack(position), np.column_stack(current)


def models(axis: Axis, position: FloatArray, current: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(y, linear columns, gated columns) of one shaft, all through the same filters.

    y (N,) [N m]; linear (N, 4): qdot, sign(qdot), qddot, 1; gated (N, 3): g sign(qdot), g qdot, g.
    """
    kernel = CommonKernel(WIDTH, PERIOD)
    angle = position @ np.array(axis.turns)
    carried = current @ np.array(axis.carries)
    gate = (np.abs(carried) > OPEN).astype(float)
    speed, push = kernel.derivative(angle), kernel.second_derivative(angle)
    sign = np.sign(speed)
    edge = 2 * kernel.margin

    def twice(values: list[FloatArray], *, fresh: bool) -> FloatArray:
        first = [kernel.smooth(v) for v in values] if fresh else values
        return np.stack([kernel.smooth(v) for v in first], axis=-1)[edge:-edge]

    linear = np.concatenate([twice([speed, push], fresh=False), twice([sign, np.ones_like(sign)], fresh=True)], axis=1)
    gated = twice([gate * sign, gate * speed, gate], fresh=True)
    return twice([carried * TORQUE_PER_AMPERE], fresh=True)[:, 0], linear, gated


def splits(samples: int) -> list[tuple[BoolArray, BoolArray]]:
    """(train, test) rows (N,), the training rows further from the held-out ones than the filters reach."""
    fold = (np.arange(samples) * PERIOD / STRETCH).astype(int) % FOLDS
    reach = 4 * CommonKernel(WIDTH, PERIOD).margin
    out = []
    for f in range(FOLDS):
        test = fold == f
        near = np.convolve(test, np.ones(2 * reach + 1), mode="same") > 0.5
        out.append((~near, test))
    return out


def left(y: FloatArray, columns: FloatArray) -> float:
    """Held-out RMS [N m] of y - columns theta, over all splits."""
    error = np.empty_like(y)
    for train, test in splits(y.size):
        theta = np.linalg.lstsq(columns[train], y[train], rcond=None)[0]
        error[test] = y[test] - columns[test] @ theta
    return float(np.sqrt(np.mean(error**2)))


def rows(data: Path, progress: Progress = lambda text, share: None) -> list[RealRow]:
    """The table: how often the report is open, and what the linear and the gated model leave on held-out stretches."""
    position, current = wrist_of(data)
    motors = motor_axes(MOTORS, MOTOR_TURNS)
    out = []
    for axis in (*motors, *joint_axes(JOINTS)[1:]):
        y, linear, gated = models(axis, position, current)
        whole = float(np.sqrt(np.mean(y**2)))
        before, after = left(y, linear), left(y, gated)
        open_share = float(np.mean(np.abs(current @ np.array(axis.carries)) > OPEN))
        note = "dead zone of the reported current" + ("" if axis in motors else "; per joint, not per motor")
        out += [
            RealRow(f"{axis.name}/report_open", open_share, "-", note="share of samples that are not exactly zero"),
            RealRow(f"{axis.name}/linear_share", before / whole, "-", note=f"of {whole:.3g} N*m"),
            RealRow(f"{axis.name}/gated_share", after / whole, "-", note="three parameters instead of four"),
            RealRow(f"{axis.name}/explained", 1.0 - (after / before) ** 2, "-", note=note),
        ]
    return out
