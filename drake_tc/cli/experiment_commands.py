"""`drake-tc design` and `drake-tc rehearse`.

`drake-tc design`: the next experiment, within limits.

`drake-tc rehearse`: would this set-up have found it?
"""

import json
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from drake_tc.cli.options import LARGEST_SEED, Declared, Force
from drake_tc.cli.out_files import result_folder
from drake_tc.cli.terminal import print_wide, progress_bar, tell_declared
from drake_tc.errors import LogError, ParamsError

if TYPE_CHECKING:
    from drake_tc.diagnosis.search import Progress
    from drake_tc.experiments.design.criteria import Expected
    from drake_tc.experiments.design.request import DesignRequest
    from drake_tc.experiments.design.run import DesignOptions, JointDesign


@dataclass(frozen=True, kw_only=True)
class MotionBounds:
    """Limits of the motion; None for those of the logs."""

    position: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="<low> <high>", help="Position limits [rad or m], as in --position -0.8 0.8."),
    ] = None
    velocity: Annotated[float | None, typer.Option(help="Velocity limit [rad/s or m/s].")] = None
    acceleration: Annotated[float | None, typer.Option(help="Acceleration limit [rad/s^2 or m/s^2].")] = None
    jerk: Annotated[float | None, typer.Option(help="Jerk limit [rad/s^3 or m/s^3].")] = None
    torque: Annotated[float | None, typer.Option(help="Motor torque or force limit [N m or N].")] = None


@dataclass(frozen=True, kw_only=True)
class ExperimentOptions:
    """Options of `drake-tc design`."""

    rig: Annotated[Path, typer.Option(help="Rig file (YAML).")]
    log: Annotated[
        list[Path] | None, typer.Option(help="A recorded run, for noise, load and limits; repeat for more.")
    ] = None
    declared: Declared = None
    model: Annotated[Path | None, typer.Option(help="Model file (YAML), such as model_after.yaml.")] = None
    goal: Annotated[
        str | None,
        typer.Option(
            help="parameters (of the declared model), parameters:EFFECT,... (of effects too), tell:A,B (which of two"
            " effects it is) or all (show every effect). Default: that of the report, otherwise parameters."
        ),
    ] = None
    after: Annotated[
        Path | None, typer.Option(help="report.json of close-loop: design the experiment that it names.")
    ] = None
    joint: Annotated[list[str] | None, typer.Option(help="Joint; repeat. Default: all joints of the rig.")] = None
    duration: Annotated[float, typer.Option(help="Length of the experiment [s].")] = 30.0
    rate: Annotated[float, typer.Option(help="Rate of trajectory.csv [Hz].")] = 200.0
    limits: MotionBounds
    load: Annotated[
        list[str] | None,
        typer.Option(
            help="A known mass that you can hang on the joint in addition to what it carries: MASS@ARM in kg and m,"
            " MASS of a prismatic joint, or 0 for the joint as it is; repeat, as in --load 0 --load 1.5@0.3. A third"
            " number, as in 1.5@0.3@0.1, is the position at which it hangs straight down [rad]. The design chooses"
            " among these loads and computes a motion under each that takes part."
        ),
    ] = None
    bandwidth: Annotated[float | None, typer.Option(help="Highest frequency that the drive follows [Hz].")] = None
    basis: Annotated[str, typer.Option(help="Functions of the motion: fourier or bspline.")] = "fourier"
    criterion: Annotated[
        str | None,
        typer.Option(
            help="Optimality criterion for the goal parameters: D (determinant of the Fisher information), E (its"
            " smallest eigenvalue) or, for the motion of a whole robot, intervals (widths of the intervals relative to"
            " those after growing sinusoids). Default: intervals for a whole robot, otherwise D."
        ),
    ] = None
    distance: Annotated[float, typer.Option(help="Smallest allowed distance between links of a robot [m].")] = 0.01
    scene: Annotated[
        Path | None,
        typer.Option(help="URDF, SDF or MJCF of the robot's surroundings, in the coordinates of its world."),
    ] = None
    starts: Annotated[
        int | None,
        typer.Option(min=1, help="Number of initial guesses. Default: 4 for the motion of a whole robot, otherwise 2."),
    ] = None
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the starts.")] = 0
    out: Annotated[Path, typer.Option(help="Folder for the trajectory and the page.")] = Path("design")
    force: Force = False
    as_json: Annotated[bool, typer.Option("--json", help="Print design.json to stdout.")] = False

    def check(self) -> None:
        """Refuse values that no design can have.

        Raises:
            ParamsError: names the option and what is possible.
            LogError: the rate of the trajectory.
        """
        if self.basis not in ("fourier", "bspline"):
            raise ParamsError(f"--basis: expected fourier or bspline, got {self.basis!r}")
        if self.criterion not in (None, "intervals", "D", "E"):
            raise ParamsError(f"--criterion: expected intervals, D or E, got {self.criterion!r}")
        if not 1.0 <= self.duration <= 600.0:
            raise ParamsError(f"--duration: expected 1 to 600 s, got {self.duration:g}")
        if not 0.0 < self.distance <= 10.0:
            raise ParamsError(f"--distance: expected a distance above 0 and up to 10 m, got {self.distance:g}")
        if not 10.0 <= self.rate <= 10_000.0:
            raise LogError(f"--rate: expected 10 to 10000 Hz, got {self.rate:g}")

    def request(self) -> "DesignRequest":
        """What is to be designed.

        Raises:
            ParamsError: a load that cannot be read.
        """
        from drake_tc.experiments.design.loads import parse_loads
        from drake_tc.experiments.design.request import DesignRequest

        return DesignRequest(
            rig=self.rig,
            logs=tuple(self.log or ()),
            model=self.model,
            goal=self.goal,
            after=self.after,
            joints=tuple(self.joint or ()),
            limits={**vars(self.limits), "bandwidth_hz": self.bandwidth},
            loads=parse_loads(self.load or ()),
            declared=self.declared,
        )


def design_command(options: ExperimentOptions) -> None:
    """Compute a motion that measures a joint's parameters well, or that separates two missing effects.

    If the model of a robot gives the loads, the goal `parameters` without --joint computes one motion of all joints.
    The motion keeps the limits, and begins and ends at rest. With --load, the design also chooses which known masses
    are hung on the joint, and how long each. If no motion can separate two effects, the command ends
    with an error that states the identity between them.
    """
    from drake_tc.experiments.design.load_output import LOAD_FILES
    from drake_tc.experiments.design.output import FILES, robot_json, write_robot_design

    options.check()
    tell_declared("design", options.rig, options.declared)
    out = options.out
    read = [options.rig, *(options.log or []), options.declared, options.model, options.after, options.scene]
    with (
        result_folder(out, "--out", names=(*FILES, *LOAD_FILES), inputs=read, force=options.force) as folder,
        progress_bar("design", quiet=options.as_json) as progress,
    ):
        from drake_tc.experiments.design.request import designed_robot, whole_robot
        from drake_tc.experiments.design.robot import RobotOptions
        from drake_tc.experiments.design.run import DesignOptions

        common: dict[str, Any] = {"duration": options.duration, "basis": options.basis, "seed": options.seed}
        common |= {k: v for k in ("starts", "criterion") if (v := getattr(options, k)) is not None}
        request = options.request()
        if whole_robot(request):
            if request.loads:
                raise ParamsError("--load: the loads hang on one joint; name it with --joint")
            whole = RobotOptions(distance=options.distance, scene=options.scene, **common)
            robot = designed_robot(request, whole, progress)
            write_robot_design(robot, folder, options.rate)
            document, lines = robot_json(robot), list(robot.sentences)
        else:
            _require_of_one_joint(options.scene, options.criterion)
            document, lines = _designed_joints(request, DesignOptions(**common), folder, options.rate, progress)
    if options.as_json:
        print(json.dumps(document, indent=1))
    else:
        print("\n".join(lines))
        print(out / FILES[-1])


def _designed_joints(
    request: "DesignRequest",
    options: "DesignOptions",
    folder: Path,
    rate: float,
    progress: "Progress",
) -> tuple[dict[str, Any], list[str]]:
    """Write the design of each joint; (design.json, lines for the console)."""
    from drake_tc.experiments.design.load_design import LoadDesign
    from drake_tc.experiments.design.load_output import load_json, load_lines, write_load_design
    from drake_tc.experiments.design.output import design_json, write_design
    from drake_tc.experiments.design.request import designed

    designs: dict[str, JointDesign] = {}
    for name, design in designed(request, options, progress).items():
        if isinstance(design, LoadDesign):  # of one joint
            write_load_design(design, folder, rate)
            return load_json(design), [*load_lines(design), *expected_lines(design.expected)]
        designs[name] = design
    write_design(designs, folder, rate)
    return design_json(designs), design_lines(designs)


def _require_of_one_joint(scene: Path | None, criterion: str | None) -> None:
    if scene is not None:
        raise ParamsError("--scene: expected the motion of a whole robot (goal parameters, no --joint)")
    if criterion == "intervals":
        raise ParamsError("--criterion intervals: expected the motion of a whole robot (goal parameters, no --joint)")


def design_lines(designs: "dict[str, JointDesign]") -> list[str]:
    """What each joint's motion is expected to bring, as lines of text."""
    out = []
    for name, design in designs.items():
        out.append(f"{name}: goal {design.goal.text}")
        out += [f"  {sentence}" for sentence in design.sentences]
        out += expected_lines(design.expected)
    return out


def expected_lines(expected: "Sequence[Expected]") -> list[str]:
    """What each quantity is expected to be, as lines of text."""
    from drake_tc.report.numbers import significant

    heads = ("logs so far", "growing sinusoid", "designed motion")
    rows = [("", heads)]
    for each in expected:
        unit = f" [{each.unit}]" if each.unit not in ("", "-") else ""
        before, default, after = (
            "-" if value != value else significant(value) for value in (each.before, each.default, each.after)
        )
        rows.append((f"{each.name}{unit}", (before, default, after)))
    wide = max(len(name) for name, _ in rows)
    return [
        f"  {name:{wide}}  " + "  ".join(f"{text:>{len(head)}}" for text, head in zip(cells, heads, strict=True))
        for name, cells in rows
    ]


@dataclass(frozen=True, kw_only=True)
class RehearsalOptions:
    """Options of `drake-tc rehearse`."""

    rig: Annotated[Path, typer.Option(help="Rig file (YAML).")]
    log: Annotated[list[Path], typer.Option(help="A run; repeat. Without --holdout the last one is held out.")]
    with_: Annotated[str, typer.Option("--with", help="EFFECT or EFFECT=SIZE, such as backlash=0.001.")]
    holdout: Annotated[list[Path] | None, typer.Option(help="A run that takes no part in fitting; repeat.")] = None
    joint: Annotated[str | None, typer.Option(help="Joint; only needed where the rig has several.")] = None
    repeats: Annotated[int, typer.Option(help="Number of trials at each size.")] = 4
    jobs: Annotated[int, typer.Option(help="Number of parallel processes.")] = 2
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of noise and phases.")] = 0
    out: Annotated[Path, typer.Option(help="Folder for rehearsal.html and rehearsal.json.")] = Path("rehearsal")
    force: Force = False
    as_json: Annotated[bool, typer.Option("--json", help="Print rehearsal.json to stdout.")] = False


def rehearse_command(options: RehearsalOptions) -> None:
    """Add an effect to your own runs by simulation, diagnose them, and count how often it is found.

    Motions, loads, sensors and noise are those of the logs. The result is the rate of detection over the effect's size,
    and the effects that were named in its place.
    """
    from drake_tc.analysis.sweep import processes
    from drake_tc.experiments.rehearsal.run import (
        FILES,
        parse_effect,
        power_table,
        rehearsal_json,
        rehearsal_page,
        rehearse,
        summary,
    )
    from drake_tc.experiments.rehearsal.twin import twin_of
    from drake_tc.logs.prepare import load_runs
    from drake_tc.logs.rig import load_rig

    rig, log, out, repeats, jobs = options.rig, options.log, options.out, options.repeats, options.jobs
    if not 1 <= repeats <= 200:
        raise ParamsError(f"--repeats: expected 1 to 200, got {repeats}")
    effect_id, size = parse_effect(options.with_)
    tested = list(options.holdout or log[-1:])
    fitted = [path for path in log if path not in tested]
    if not fitted:
        raise LogError(f"expected at least two runs, one --log RUN to fit and one to test, got {len(log)}")
    with (
        result_folder(out, "--out", names=FILES, inputs=[rig, *log, *tested], force=options.force) as folder,
        progress_bar("rehearse", quiet=options.as_json) as progress,
        processes(jobs) if jobs > 1 else nullcontext() as pool,
    ):
        read = load_rig(rig)
        name = _joint(read.joints, options.joint)
        progress("reading", 0.0)
        runs = load_runs([*fitted, *tested], read)
        held = [run.name for run in runs[len(fitted) :]]
        twin = twin_of(read, runs, name)
        found = rehearse(
            twin, effect_id, size, held, repeats=repeats, seed=options.seed, executor=pool, progress=progress
        )
        (folder / FILES[0]).write_text(rehearsal_page(found), encoding="utf-8")
        (folder / FILES[1]).write_text(json.dumps(rehearsal_json(found), indent=1) + "\n", encoding="utf-8")
    if options.as_json:
        print(json.dumps(rehearsal_json(found), indent=1))
    else:
        table = power_table(found)
        print(summary(found))
        print_wide(table.headings, table.rows, left=table.headings[-1:])
        print(out / FILES[0])


def _joint(joints: tuple[str, ...], asked: str | None) -> str:
    if asked is None and len(joints) == 1:
        return joints[0]
    if asked not in joints:
        raise ParamsError(f"--joint: expected one of {', '.join(joints)}, got {asked or 'none'}")
    return str(asked)
