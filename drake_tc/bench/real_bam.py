"""`bench real-bam`: free runs of an XL330 on a pendulum, each trajectory held out in turn at every firmware gain.

One motor, three firmware gains, four trajectories. For each trajectory the motor is identified from the other three at
all gains, as a voltage drive: first on the torque balance (equation error), then on the free runs of the training runs
(output error). The firmware's known law then makes it the position servo of each gain, and the Drake diagram of that
servo on the pendulum is driven by the held-out goal positions alone, over the stretch with torque on.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.position_loop import PositionLoop, through_loop
from drake_tc.bench.real_rows import RealRow
from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.effects.library import effect
from drake_tc.errors import LogError, RigError
from drake_tc.identification.output_error import OutputErrorOptions, Trial, refine_from_starts
from drake_tc.logs.importers.bam import JOINT, convert
from drake_tc.logs.loads import GRAVITY, Pendulum
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, load_rig
from drake_tc.types import FloatArray

DATA_SET = "bam-xl330-pendulum"
GAINS = (100, 200, 800)
TRAJECTORIES = ("sin_sin", "lift_and_drop", "up_and_down", "sin_time_square")
TO_REACH = 0.045
"""Mean absolute position error [rad] at every gain."""
SUPPLY = 7.3
"""[V], the measured supply's median with torque on."""

FreeRun = Callable[[ActuatorModel, Rig, str, Run], tuple[FloatArray, FloatArray, FloatArray] | None]
Progress = Callable[[str, float], None]


def firmware_loop(kp: float) -> PositionLoop:
    """Duty = kp 4096/(2 pi)/(256 885) (q_d - q), clipped to +-1, times the supply."""
    return PositionLoop(SUPPLY * kp * 4096.0 / (2.0 * math.pi) / (256.0 * 885.0), SUPPLY)


@dataclass(frozen=True)
class Recorded:
    """The runs of one firmware gain, by trajectory: as a position servo's and as a voltage drive's."""

    servo_rig: Rig
    voltage_rig: Rig
    servo: Mapping[str, Run]
    voltage: Mapping[str, Run]


def read_runs(data: Path) -> dict[int, Recorded]:
    """All runs of the data set, by firmware gain.

    Raises:
        LogError: there is no such data set under `data`.
    """
    folder = data if data.name == DATA_SET else data / DATA_SET
    if not folder.is_dir():
        raise LogError(f"{folder}: no such folder; wanted the data set {DATA_SET}")
    out = {}
    with TemporaryDirectory() as place:
        convert(folder, Path(place))
        for kp in GAINS:
            home = Path(place) / f"xl330_kp{kp}"
            paths = [home / f"{name}.parquet" for name in TRAJECTORIES]
            servo, voltage = load_rig(home / "rig_servo.yaml"), load_rig(home / "rig.yaml")
            runs = (dict(zip(TRAJECTORIES, load_runs(paths, rig), strict=True)) for rig in (servo, voltage))
            out[kp] = Recorded(servo, voltage, *runs)
    return out


def trial_of(run: Run, rig: Rig, kp: int) -> Trial:
    """The longest stretch with torque on, driven by the goal position through the firmware's law, from rest."""
    load = rig.load[JOINT]
    if not isinstance(load, Pendulum):
        raise RigError(f"{run.name}: wanted a pendulum as load; got {load!r}")
    stretch = max(run.segments(), key=lambda s: s.stop - s.start)
    return Trial(
        name=f"kp{kp}/{run.name}",
        period=run.period,
        command=run.columns[f"{JOINT}/position_command"][stretch],
        position=run.columns[f"{JOINT}/position"][stretch],
        velocity=0.0,
        inertia=load.inertia,
        gravity_moment=load.mass * GRAVITY * load.length,
        loop=firmware_loop(kp),
    )


def first_model(runs: Sequence[Run], rig: Rig) -> ActuatorModel:
    """Equation error on the voltage runs: gain, inertia and friction that grows with the load."""
    names = ("viscous", "coulomb", "rotor_inertia", "load_dependent_friction")
    fitted = fit(Columns(build_samples(runs, rig, JOINT)), [Term(effect(name)) for name in names])
    values = [
        EffectValue(name, {effect(name).coefficients[0].name: float(theta)})
        for name, theta in zip(names, fitted.beta[1:], strict=True)
    ]
    return ActuatorModel(JOINT, Drive("voltage", fitted.gain), tuple(values))


RICHER = (
    EffectValue("drive_compression", {"half_effort": 10.0 * SUPPLY}),
    EffectValue("winding_heat", {"warm_effort": 1.5 * SUPPLY, "warm_time": 2.0}),
    EffectValue("load_stribeck", {"load_stribeck": 0.1, "load_stribeck_velocity": 0.3}),
    EffectValue("load_tilt", {"tilt_moment": 0.0}),
)
"""What the balance cannot start from: effects of rest and of slow warming, at values where they do little."""

TYPICAL = ActuatorModel(
    JOINT,
    Drive("voltage", 10.0),
    (
        EffectValue("viscous", {"viscous": 0.03}),
        EffectValue("coulomb", {"coulomb": 0.01}),
        EffectValue("rotor_inertia", {"rotor_inertia": 0.002}),
        EffectValue("load_dependent_friction", {"load_friction": 0.4}),
    ),
)
"""A second start and the prior, of a small geared servo's size: slow runs leave inertia and load friction open."""


def published(kt: float, resistance: float, inertia: float, base: float, viscous: float) -> ActuatorModel:
    """A published Coulomb-viscous model (M1) in our terms; back-EMF goes into the viscous friction."""
    effects = (
        EffectValue("rotor_inertia", {"rotor_inertia": inertia}),
        EffectValue("viscous", {"viscous": viscous + kt**2 / resistance}),
        EffectValue("coulomb", {"coulomb": base}),
    )
    return ActuatorModel(JOINT, Drive("voltage", resistance / kt), effects)


M1 = published(0.323, 4.764, 0.00164, 0.00697, 0.01049)


def free_run_error(model: ActuatorModel, recorded: Recorded, name: str, kp: int, free_run: FreeRun) -> float:
    """Mean absolute position error [rad] of the Drake diagram; infinite where it diverges."""
    servo = through_loop(model, firmware_loop(kp))
    trace = free_run(servo, recorded.servo_rig, JOINT, recorded.servo[name])
    if trace is None:
        return math.inf
    _, measured, simulated = trace
    error = float(np.mean(np.abs(simulated - measured)))
    return error if math.isfinite(error) else math.inf


def identify_without(
    data: Mapping[int, Recorded], held: str, executor: Executor | None, options: OutputErrorOptions | None = None
) -> tuple[ActuatorModel, ActuatorModel]:
    """(equation error, output error): the motor from all runs of all gains but those of trajectory `held`."""
    names = [name for name in TRAJECTORIES if name != held]
    runs = [recorded.voltage[name] for recorded in data.values() for name in names]
    first = first_model(runs, next(iter(data.values())).voltage_rig)
    trials = [trial_of(rec.servo[name], rec.servo_rig, kp) for kp, rec in data.items() for name in names]
    starts = [ActuatorModel(JOINT, model.drive, (*model.effects, *RICHER)) for model in (first, TYPICAL)]
    options = options or OutputErrorOptions(prior=starts[1], evaluations=18)
    return first, refine_from_starts(starts, trials, options, executor).model


def real_bam_rows(
    data: Path,
    free_run: FreeRun,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
    held_out: Sequence[str] = TRAJECTORIES,
) -> list[RealRow]:
    """The table: each trajectory held out in turn, at every gain.

    Args:
        data: The folder of public data sets, or the data set's own.
        free_run: Simulates the Drake diagram (`drake_tc.diagrams.bench.rig_free_run.rig_free_run`).
        progress: Told how far it is.
        executor: Runs simulations beside each other.
        held_out: Which trajectories to hold out.

    Raises:
        LogError: the data set is not there.
    """
    recorded = read_runs(data)
    errors: dict[tuple[str, int, str], float] = {}
    for index, held in enumerate(held_out):
        progress(f"without {held}", index / len(held_out))
        first, refined = identify_without(recorded, held, executor)
        for kp in GAINS:
            for name, model in (("published_M1", M1), ("equation_error", first), ("output_error", refined)):
                errors[name, kp, held] = free_run_error(model, recorded[kp], held, kp, free_run)
    rows = []
    for kp in GAINS:
        mean = float(np.mean([errors["output_error", kp, held] for held in held_out]))
        note = f"mean over held-out {', '.join(held_out)}"
        rows.append(RealRow(f"free_run_mae/kp{kp}", mean, "rad", TO_REACH, "max", note=note))
    rows += [RealRow(f"{n}/kp{kp}/{held}", value, "rad") for (n, kp, held), value in errors.items()]
    return rows
