"""`bench real-double-pendulum`: torques of two quasi-direct drives on whole runs that took no part in the fit."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from drake_tc.bench.real_arm import found_on, looked_for, pooled, rms, set_folder
from drake_tc.bench.real_rows import RealRow
from drake_tc.diagnosis.arm import ArmHeldOut, declare, declared_friction, hold_out_arm
from drake_tc.diagnosis.problem.arm.rows import ArmRows, JointLog, arm_rows
from drake_tc.diagnosis.problem.arm.shafts import joint_axes
from drake_tc.diagnosis.thresholds import ARM
from drake_tc.errors import LogError
from drake_tc.logs.importers.dfki import DOUBLE_JOINTS, TORQUE_PER_AMPERE, convert
from drake_tc.logs.readers import read_table
from drake_tc.robot.rigid_regressor import LinkTree, regressor
from drake_tc.types import BoolArray, FloatArray

DATA_SET = "dfki-double-pendulum"
DESIGNS = {"A0_20220815": 0.3, "C0_20220914": 0.2}
"""Runs whose torque is the drives' report, and the upper link's length [m]. The older runs hold the command."""
WANTED = 0.75
PERIOD = 0.002
WIDTH = 0.035
"""Of the kernel that the torque passes twice [s]: together as narrow as the published 50 ms filter."""
MOTION_WIDTHS = (0.035, 0.06, 0.09, 0.13, 0.18, 0.25)
"""Of the kernel that the motion passes twice [s]: which of them is decided on the training runs."""
SLOWEST = 0.05
MOST = replace(ARM, most=6)
FOLDS = 3
"""Every third run is held out, in turn, in the order of their names."""

Progress = Callable[[str, float], None]


def planar_tree(upper_length: float) -> LinkTree:
    """Two links that hang along -z and turn about y."""
    return LinkTree(
        joints=DOUBLE_JOINTS,
        links=("upper", "lower"),
        parent=(-1, 0),
        R_PF=np.stack([np.eye(3), np.eye(3)]),
        p_PF=np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -upper_length]]),
        axis=np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 0.0]]),
        revolute=(True, True),
        gravity=np.array([0.0, 0.0, -9.81]),
    )


def separate_joints(columns: FloatArray) -> FloatArray:
    """(T, n, p) to (T, n, n p): every joint has parameters of its own, as in the pooled least squares."""
    samples, joints, size = columns.shape
    out = np.zeros((samples, joints, joints, size))
    for j in range(joints):
        out[:, j, j] = columns[:, j]
    return out.reshape(samples, joints, joints * size)


def designs_in(data: Path) -> list[str]:
    """The designs whose runs are in the set.

    Raises:
        LogError: none is.
    """
    folder = set_folder(data, DATA_SET)
    found = [design for design in DESIGNS if any(folder.glob(f"{design}_*"))]
    if not found:
        raise LogError(f"{folder}: no runs of a known design; expected files that begin with {', '.join(DESIGNS)}")
    return found


def logs_of(data: Path, design: str) -> list[JointLog]:
    """The design's runs at one period.

    Raises:
        LogError: the set is not in `data`.
    """
    logs = []
    with TemporaryDirectory() as scratch:
        convert(set_folder(data, DATA_SET), Path(scratch))
        for path in sorted((Path(scratch) / f"double_{design}").glob("*.parquet")):
            table = read_table(path)
            time = table["time"].to_numpy(float)
            grid = np.arange(time[0], time[-1], PERIOD)
            fresh = np.concatenate([[True], np.diff(time) > 1e-5])
            columns = {
                name: np.column_stack(
                    [np.interp(grid, time[fresh], table[f"{j}/{name}"].to_numpy(float)[fresh]) for j in DOUBLE_JOINTS]
                )
                for name in ("position", "current")
            }
            logs.append(JointLog(path.stem, PERIOD, columns["position"], columns["current"] * TORQUE_PER_AMPERE))
    return logs


def rows_of(logs: list[JointLog], upper_length: float, motion_width: float) -> tuple[ArmRows, FloatArray]:
    """The runs of one design, the motion through a kernel of the given width."""
    tree = planar_tree(upper_length)
    return arm_rows(
        logs,
        joint_axes(DOUBLE_JOINTS),
        lambda q, v, a: separate_joints(regressor(tree, q, v, a)),
        (WIDTH, motion_width),
        SLOWEST,
    )


def held_out(data: Path, design: str, *, search: bool = True) -> list[tuple[float, FloatArray, ArmHeldOut]]:
    """Each third of the runs predicted from the others.

    Returns:
        For each: the motion's width chosen on the training runs, the pooled least squares' residual on the same
        held-out rows [N m], and what was found.
    """
    logs = logs_of(data, design)
    prepared = []
    for width in MOTION_WIDTHS:
        rows, raw = rows_of(logs, DESIGNS[design], width)
        prepared.append(declare(rows, raw, declared_friction(2, 2, inertia=False)))
    shared = _common_rows([rows for rows, _, _ in prepared])
    prepared = [(rows.take(keep), raw, placed) for (rows, raw, placed), keep in zip(prepared, shared, strict=True)]
    out = []
    for fold in range(FOLDS):
        tests = [rows.run % FOLDS == fold for rows, _, _ in prepared]
        plain = [hold_out_arm(*p, test, ()) for p, test in zip(prepared, tests, strict=True)]
        scores = [float(np.sum(np.log(r.baseline.cv_rms))) for r in plain]
        best = int(np.argmin(scores))
        found = hold_out_arm(*prepared[best], tests[best], looked_for(), MOST) if search else plain[best]
        out.append((MOTION_WIDTHS[best], plain[0].before, found))
    return out


def _common_rows(all_rows: list[ArmRows]) -> list[BoolArray]:
    """For each preparation, which of its rows are rows of all (their edges and rests differ a little)."""
    common = set(all_rows[0].rows.tolist())
    for rows in all_rows[1:]:
        common &= set(rows.rows.tolist())
    wanted = np.array(sorted(common))
    return [np.isin(rows.rows, wanted) for rows in all_rows]


def rows(data: Path, progress: Progress = lambda text, share: None) -> list[RealRow]:
    """The table: what is left of each joint's torque beside the pooled least squares, by design."""
    out = []
    present = designs_in(data)
    for number, design in enumerate(present):
        progress("designs", number / len(present))
        results = held_out(data, design)
        found = [each for _, _, each in results]
        least_squares = rms(np.concatenate([plain for _, plain, _ in results]))
        whole, before, after = pooled(found)
        widths = ", ".join(f"{width:g}" for width, _, _ in results)
        for j, joint in enumerate(DOUBLE_JOINTS):
            ratio = after[j] / least_squares[j]
            told = f"of {whole[j]:.3g} N*m"
            out += [
                RealRow(f"{design}/{joint}/pooled_least_squares", least_squares[j], "N*m", note=told),
                RealRow(f"{design}/{joint}/shared_band", before[j], "N*m", note=f"motion's width {widths} s"),
                RealRow(f"{design}/{joint}/residual", after[j], "N*m", note=found_on(found, j)),
                RealRow(f"{design}/{joint}/ratio", ratio, "-", WANTED, "max", note="to the pooled one"),
            ]
    progress("designs", 1.0)
    return out
