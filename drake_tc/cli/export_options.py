"""Options of `drake-tc export`: the target, the runs that it is tried on, and what single targets need."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from drake_tc.cli.options import LARGEST_SEED, Force
from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from drake_tc.exchange.actuator_configs import ServoSettings
    from drake_tc.exchange.c_code import CSpec


class Target(StrEnum):
    """Where to."""

    mjcf = "mjcf"
    mjlab = "mjlab"
    playground = "playground"
    newton = "newton"
    urdf = "urdf"
    drake_urdf = "drake-urdf"
    sdf = "sdf"
    isaaclab = "isaaclab"
    isaaclab_bam = "isaaclab-bam"
    bam = "bam"
    parquet = "parquet"
    c = "c"


@dataclass(frozen=True, kw_only=True)
class RecordedRuns:
    """Runs of the joints, and the page on the errors of the export on them."""

    rig: Annotated[Path | None, typer.Option(help="Rig file of the runs of --log and --holdout.")] = None
    log: Annotated[
        list[Path] | None, typer.Option(help="A run whose speeds weight the refit of friction; repeat for more.")
    ] = None
    holdout: Annotated[
        list[Path] | None,
        typer.Option(
            help="A run to try the export on: in MuJoCo (mjcf), Drake (drake-urdf, urdf, sdf), BAM's equations (bam);"
            " repeat for more."
        ),
    ] = None
    page: Annotated[
        Path | None, typer.Option(help="HTML file with the lost effects, the errors and the written parameters.")
    ] = None

    @property
    def files(self) -> list[Path | None]:
        """What is read."""
        return [self.rig, *(self.log or []), *(self.holdout or [])]

    def speeds(self, joints: Sequence[str]) -> dict[str, Any]:
        """(T,) velocities and loads of each joint in the runs to fit; None for loads that are not known."""
        if self.rig is None or not self.log:
            return {}
        from drake_tc.exchange.trial import recorded_loads, recorded_speeds
        from drake_tc.logs.prepare import load_runs
        from drake_tc.logs.rig import load_rig

        what = load_rig(self.rig)
        runs = load_runs(self.log, what)
        loads = recorded_loads(runs, what, joints)
        return {name: (each, loads.get(name)) for name, each in recorded_speeds(runs, what, joints).items()}


@dataclass(frozen=True, kw_only=True)
class ServoData:
    """What the data sheet of a servo says, which logs of the motor voltage do not contain."""

    torque_constant: Annotated[
        float | None,
        typer.Option(
            help="Torque constant of the data sheet [N m/A] of a drive on a voltage: needed by bam and isaaclab-bam;"
            " makes a dcmotor in mjcf and newton, a BuiltinDcMotorActuatorCfg in mjlab and a DCMotorCfg in isaaclab."
        ),
    ] = None
    supply_voltage: Annotated[
        float | None, typer.Option(help="Supply voltage of the servo [V]: needed by isaaclab-bam.")
    ] = None
    position_gain: Annotated[
        float | None,
        typer.Option(
            help="Gain of the servo's own position loop, motor voltage per error [V/rad]: needed by isaaclab-bam."
        ),
    ] = None

    def settings(self) -> "ServoSettings":
        """Voltage and gain.

        Raises:
            ParamsError: one of them is not given.
        """
        from drake_tc.exchange.actuator_configs import ServoSettings

        if self.supply_voltage is None or self.position_gain is None:
            came = "--supply-voltage alone" if self.supply_voltage is not None else "neither"
            came = "--position-gain alone" if self.position_gain is not None else came
            raise ParamsError(
                f"export --to isaaclab-bam: expected --supply-voltage and --position-gain of the servo, got {came};"
                " logs of the motor voltage do not contain them"
            )
        return ServoSettings(self.supply_voltage, self.position_gain)


@dataclass(frozen=True, kw_only=True)
class CodeSettings:
    """What `--to c` writes."""

    robot: Annotated[
        Path | None, typer.Option(help="Robot file with a fixed base: adds inverse dynamics and gravity to --to c.")
    ] = None
    kp: Annotated[float, typer.Option(help="Torque feedback of --to c [-].")] = 0.0
    ki: Annotated[float, typer.Option(help="Integral of the torque error of --to c [1/s].")] = 0.0
    period: Annotated[float, typer.Option(help="Period of the calls of --to c [s].")] = 1e-3
    window: Annotated[int, typer.Option(help="Samples of the position filter of --to c.")] = 80

    def spec(self, name: str) -> "CSpec":
        """The same for a file of that name.

        Raises:
            ParamsError: a value that is not possible.
        """
        from drake_tc.exchange.c_code import CSpec

        return CSpec(name=name, dt=self.period, window=self.window, kp=self.kp, ki=self.ki)


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """Options of `drake-tc export`."""

    model: Annotated[Path, typer.Argument(help="Model file (YAML) of close-loop or identify.")]
    to: Annotated[
        Target, typer.Option(metavar="TARGET", help=f"Simulator for which the model is written: {', '.join(Target)}.")
    ]
    into: Annotated[Path | None, typer.Option(help="Your own file; the parameters are merged into a copy of it.")] = (
        None
    )
    out: Annotated[Path | None, typer.Option(help="File to write; stdout when left out.")] = None
    joint: Annotated[list[str] | None, typer.Option(help="Only this joint; repeat. All when left out.")] = None
    runs: RecordedRuns
    servo: ServoData
    ranges: Annotated[
        bool,
        typer.Option(
            "--ranges",
            help="Write how far each parameter may be randomised instead of the model: terms of mjlab, events of Isaac"
            " Lab, a function for MuJoCo Playground, or samples (parquet).",
        ),
    ] = False
    report: Annotated[
        Path | None,
        typer.Option(help="report.json with the intervals for --ranges; that beside the model when left out."),
    ] = None
    unit: Annotated[
        list[Path] | None,
        typer.Option(
            help="Model file of another unit of the same robot, diagnosed alike: the spread between units is part of"
            " --ranges; repeat for more."
        ),
    ] = None
    remainder: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the remainder of each joint as an ONNX network, with --to isaaclab, isaaclab-bam or"
            " newton; no exported actuator uses it by itself."
        ),
    ] = None
    code: CodeSettings
    samples: Annotated[int, typer.Option(min=1, help="Rows of --ranges --to parquet.")] = 1000
    force: Force = False
    as_json: Annotated[bool, typer.Option("--json", help="Print terms, losses and errors as JSON.")] = False
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the draws of --ranges.")] = 0

    def require_used(self) -> None:
        """Refuse options without an effect: those of another target, and a rig file without runs.

        Raises:
            ParamsError: names the option and what it belongs to.
        """
        servo = {key: vars(self.servo)[key] for key in ("supply_voltage", "position_gain")}
        of_target = (
            (Target.c, {key: value for key, value in vars(self.code).items() if value != vars(CodeSettings())[key]}),
            (Target.isaaclab_bam, {key: value for key, value in servo.items() if value is not None}),
        )
        for target, given in of_target:
            if given and (self.ranges or self.to is not target):
                option = "--" + next(iter(given)).replace("_", "-")
                came = "--ranges" if self.ranges else f"--to {self.to}"
                raise ParamsError(f"export: {option} belongs to --to {target}, got {came}; leave it out")
        runs = self.runs
        if runs.rig is not None and not (runs.log or runs.holdout):
            raise ParamsError(
                "export: --rig describes the runs of --log and --holdout, got none; add them or leave it out"
            )

    @property
    def shown(self) -> TextIO:
        """Where sentences and tables go: what is written to stdout stands there alone."""
        return sys.stderr if self.out is None else sys.stdout
