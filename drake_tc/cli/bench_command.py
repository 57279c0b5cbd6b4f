"""`drake-tc bench`: benchmarks that print rows, for people or with --json for programs."""

import os
from pathlib import Path
from typing import Annotated

import typer

from drake_tc.analysis.executors import processes
from drake_tc.cli.bench_arms_command import bench_arms
from drake_tc.cli.bench_close_loop_command import bench_close_loop
from drake_tc.cli.bench_design_arm_command import bench_design_arm
from drake_tc.cli.bench_diagnosis_command import bench_diagnosis
from drake_tc.cli.bench_experiments_command import bench_check, bench_experiments
from drake_tc.cli.bench_floor_command import bench_floor
from drake_tc.cli.bench_qp_command import bench_qp
from drake_tc.cli.bench_real_logs_command import bench_real_logs
from drake_tc.cli.bench_robot_command import bench_robot
from drake_tc.cli.bench_table import print_rows
from drake_tc.cli.bench_tick_command import bench_tick
from drake_tc.cli.progress import progress_bar
from drake_tc.cli.seed_option import UnusedSeed

bench_app = typer.Typer(
    help="Benchmarks: rows of figures, with --json for programs.", no_args_is_help=True, rich_markup_mode=None
)
bench_app.command("diagnosis", short_help="Diagnosis of simulated joints.")(bench_diagnosis)
bench_app.command("check", short_help="What a check predicts.")(bench_check)
bench_app.command("experiments", short_help="Designed experiments.")(bench_experiments)
bench_app.command("design-arm", short_help="Designed motion of an arm.")(bench_design_arm)
bench_app.command("close-loop", short_help="Time and memory of close-loop.")(bench_close_loop)
bench_app.command("robot", short_help="Diagnosis of a simulated leg.")(bench_robot)
bench_app.command("arms", short_help="Diagnosis of simulated arms.")(bench_arms)
bench_app.command("qp", short_help="Solvers of quadratic programs.")(bench_qp)
bench_app.command("floor", short_help="Contact approximations.")(bench_floor)
bench_app.command("tick", short_help="Time of a whole-body tick.")(bench_tick)
bench_app.command("real-logs", short_help="close-loop on public logs.")(bench_real_logs)


@bench_app.command("leg", short_help="Time of a leg's tick.")
def bench_leg(
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
    seed: UnusedSeed = 0,
) -> None:
    """Time a tick of the leg's loops with all stages on, and the torque estimate of a leg and of a humanoid."""
    from drake_tc.benchmarks.leg_timing import leg_timings

    with progress_bar("bench leg", quiet=as_json) as progress:
        rows = leg_timings(progress)
    print_rows("leg", rows, as_json=as_json)


@bench_app.command("sweep", short_help="Speed of parameter sweeps.")
def bench_sweep(
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
    seed: UnusedSeed = 0,
) -> None:
    """Time sweeps: the speed-up of two processes over one, and a stability map of 10^4 loops."""
    from drake_tc.benchmarks.sweep_speed import sweep_rows

    with progress_bar("bench sweep", quiet=as_json) as progress:
        rows = sweep_rows(progress)
    print_rows("sweep", rows, as_json=as_json)


Data = Annotated[Path, typer.Option(help="Folder that holds the public data sets, or the set itself.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")]


@bench_app.command("real-bam", short_help="Public logs: XL330 pendulum.")
def bench_real_bam(
    data: Data,
    as_json: AsJson = False,
    seed: UnusedSeed = 0,
) -> None:
    """XL330 pendulum: print the position error of free runs on held-out trajectories, at every gain."""
    from drake_tc.benchmarks.real_bam import real_bam_rows
    from drake_tc.loops.joint_bench.rig_free_run import rig_free_run

    with (
        progress_bar("bench real-bam", quiet=as_json) as progress,
        processes(os.cpu_count() or 1) as pool,
    ):
        rows = real_bam_rows(data, rig_free_run, progress, pool)
    print_rows("real-bam", rows, as_json=as_json)


@bench_app.command("real-dfki", short_help="Public logs: AK80-6 pendulum.")
def bench_real_dfki(
    data: Data,
    as_json: AsJson = False,
    seed: UnusedSeed = 0,
) -> None:
    """AK80-6 simple pendulum: print the torque residual on held-out runs."""
    from drake_tc.benchmarks.real_dfki import rows

    print_rows("real-dfki", rows(data), as_json=as_json)


@bench_app.command("real-tmotor", short_help="Public logs: AK80-9 on a bench.")
def bench_real_tmotor(
    data: Data,
    as_json: AsJson = False,
    seed: UnusedSeed = 0,
) -> None:
    """AK80-9 with a torque sensor: print the torque error on held-out logs beside that of the published model."""
    from drake_tc.benchmarks.real_tmotor import rows

    print_rows("real-tmotor", rows(data), as_json=as_json)


@bench_app.command("real-uart", short_help="Public logs: backlash stand.")
def bench_real_uart(
    data: Data,
    as_json: AsJson = False,
    seed: UnusedSeed = 0,
) -> None:
    """Feetech servos on a backlash stand: separate backlash from dead zone, and compare with the published values."""
    from drake_tc.benchmarks.real_uart import rows

    print_rows("real-uart", rows(data), as_json=as_json)


@bench_app.command("real-robots", short_help="Public logs: fitted links.")
def bench_real_robots(
    data: Data,
    name: Annotated[list[str] | None, typer.Option("--set", help="A data set; repeat for more. Default: all.")] = None,
    as_json: AsJson = False,
    seed: UnusedSeed = 0,
) -> None:
    """Compare close-loop with fitted links with plain least squares: held-out errors by joint, and a known payload."""
    from drake_tc.benchmarks.real_robots import rows

    with progress_bar("bench real-robots", quiet=as_json) as progress:
        table = rows(data, name or (), progress)
    print_rows("real-robots", table, as_json=as_json)


@bench_app.command("real-icub", short_help="Public logs: walking humanoid.")
def bench_real_walking(
    data: Data,
    as_json: AsJson = False,
    seed: UnusedSeed = 0,
) -> None:
    """Walking humanoid: compare the base estimate with motion capture and with the published leg odometry."""
    from drake_tc.benchmarks.real_icub import rows

    with progress_bar("bench real-icub", quiet=as_json) as progress:
        table = rows(data, progress)
    print_rows("real-icub", table, as_json=as_json)
