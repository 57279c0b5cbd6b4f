"""A voltage-driven motor from its logs, anchored to its data sheet (Faraji et al., 2015, section II.A).

The logs tell, by linear least squares on v = K (tau + F_v theta' + tau_co sign(theta') + J theta''), four numbers

    K = Rm/(kt N),   K F_v,   K tau_co,   K J                with F_v = tau_v + ke kt N^2/Rm, J = Jm N^2

for six unknowns: kt and Rm only as their ratio, ke only with tau_v. The data sheet says the rest. With ke = c kt (c = 1
for an ideal motor, which the paper takes), and x = (log kt, log Rm, log Jm, tau_co, tau_v),

    min_x  |S^-1/2 (z - f(x))|^2 + sum_i ((x_i - prior_i)/width_i)^2                  (maximum a posteriori)

z, S: the four numbers and their covariance. What the logs leave open keeps the width of its prior; `spread` says so.
`pull`, (x_i - prior_i)/width_i at the minimum, says how far logs and data sheet contradict each other.

An interval is of the logs' statistics and of the data sheet: where model and sheet hold it contains the truth in 95 %
of the cases. It knows nothing of effects that the model lacks (ripple, Stribeck, a warm motor) but for
`PriorWidths.model`.

Data sheets of voltage-driven motors as YAML, the prior of `identify_motor`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares as nonlinear_least_squares

from drake_tc.actuation.plant import VoltageMotor
from drake_tc.config.records import read_record
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import IdentificationError, ParamsError
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.identification.regression import LinearFit, least_squares
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

NAMES = (
    "the voltage for a torque, Rm/(kt N)",
    "the voltage for a speed",
    "the voltage for dry friction",
    "the voltage for an acceleration",
)
"""Of the four numbers."""
UNKNOWNS = ("torque_constant", "resistance", "rotor_inertia", "coulomb", "viscous")
CI95 = 1.96
WIDTH_S = 0.03
"""Width of the common smoothing kernel [s]."""
SLIDING = 0.05
"""Share of the fastest speed below which samples are left out: where a joint sticks, dry friction is whatever holds."""

FEWEST_STEPS = 20
"""Steps of its encoder that a joint must move by at least."""
LEAST_TRAVEL = 1e-3
"""What it must move by at least [rad]."""
DOUBTFUL, CONTRADICTION = 3.0, 5.0
"""Deviations off the data sheet that are told, and that no data sheet that fits the motor has."""


@dataclass(frozen=True)
class PriorWidths:
    """One standard deviation of what the data sheet may be off by.

    Attributes:
        torque_constant, resistance, rotor_inertia: As shares [-].
        coulomb, viscous: [N m], [N m s/rad]; a data sheet has none of a whole joint, so they are wide.
        model: Share by which the four numbers may be off for what the model lacks [-], beside their own statistics.
    """

    torque_constant: float = 0.1
    resistance: float = 0.15
    rotor_inertia: float = 0.2
    coulomb: float = 3.0
    viscous: float = 1.5
    model: float = 0.003

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0.0):
                raise IdentificationError(f"{name}: expected a positive number, got {value!r}")


@dataclass(frozen=True, eq=False)
class MotorFit:
    """What logs and data sheet come to.

    Attributes:
        joint: Whose motor.
        motor: The motor.
        spread: Unknown to its 95 % interval.
        from_logs: Unknown to the share of its prior's variance that the logs took away [-]: 0 tells that the number is
            the data sheet's.
        pull: Unknown to how many of its prior's deviations it is off the data sheet [-].
        cost: What was minimised, at the minimum; its expectation is 4, the number of things that the logs tell.
        fit: The linear fit of the four numbers.
        notes: Sentences on what is doubtful.
    """

    joint: str
    motor: VoltageMotor
    spread: dict[str, tuple[float, float]]
    from_logs: dict[str, float]
    pull: dict[str, float]
    cost: float
    fit: LinearFit
    notes: tuple[str, ...] = ()


def check_motor_rig(rig: Rig, joint: str) -> None:
    """Refuse a joint of a rig that cannot be fitted by this method.

    Raises:
        IdentificationError: no such joint, or another drive or load.
    """
    if joint not in rig.joints:
        raise IdentificationError(f"no joint {joint!r} in the rig; joints here: {', '.join(rig.joints)}")
    if rig.drive[joint] != "voltage" or rig.load[joint] != "torque":
        raise IdentificationError(
            f"{joint}: expected drive voltage and load torque, got {rig.drive[joint]} and {rig.load[joint]}"
        )


def identify_motor(
    runs: Sequence[Run],
    rig: Rig,
    sheet: VoltageMotor,
    *,
    joint: str | None = None,
    widths: PriorWidths | None = None,
) -> MotorFit:
    """Fit one joint's motor.

    Args:
        runs: With position (of the motor, over the gear), voltage and torque behind the gear.
        rig: Drive `voltage`, load `torque`; what it declares of the inertia is not used.
        sheet: The data sheet; gear ratio, spring and voltage limit are taken as they are, ke/kt too.
        joint: Which joint; None for the rig's first.
        widths: How far the data sheet is trusted.

    Raises:
        IdentificationError: another drive or load, columns that are missing, an excitation too poor, or logs that
            contradict the data sheet.
    """
    name = rig.joints[0] if joint is None else joint
    check_motor_rig(rig, name)
    columns, volts, lengths = _samples(runs, rig, name)
    speed = np.abs(columns[:, 1])
    sliding = (speed > SLIDING * np.percentile(speed, 99)).astype(np.float64)
    try:
        fit = least_squares(columns, volts, names=NAMES, weights=sliding, lengths=lengths)
    except IdentificationError as error:
        raise IdentificationError(f"{name}: {error}") from None
    return _with_prior(name, fit, sheet, widths or PriorWidths())


def _samples(runs: Sequence[Run], rig: Rig, joint: str) -> tuple[FloatArray, FloatArray, tuple[int, ...]]:
    """(T, 4) [torque, speed, direction, acceleration], (T,) voltage, stretches; all through one kernel."""
    parts = []
    travel, pulled = 0.0, False
    for run in runs:
        missing = [c for c in rig.required_columns(joint) if c not in run.columns]
        if missing:
            raise IdentificationError(f"{run.name}: identification of {joint} needs {', '.join(missing)}")
        kernel = CommonKernel(WIDTH_S, run.period)
        for part in run.segments():
            if part.stop - part.start <= 2 * kernel.margin:
                continue
            position = run.columns[f"{joint}/position"][part]
            travel = max(travel, _travel(position))
            pulled = pulled or bool(np.any(run.columns[f"{joint}/torque"][part]))
            speed = kernel.derivative(position)
            rows = (
                kernel.smooth(run.columns[f"{joint}/torque"][part]),
                speed,
                kernel.smooth(np.sign(speed)),
                kernel.second_derivative(position),
                kernel.smooth(run.columns[rig.command_column(joint)][part]),
            )
            parts.append(np.stack(rows, axis=1)[kernel.valid(position.size)])
    if not parts:
        raise IdentificationError(f"no stretch of {joint}'s runs is longer than the smoothing kernel of {WIDTH_S:g} s")
    if travel < LEAST_TRAVEL:
        raise IdentificationError(
            f"{joint}: excitation too poor: expected a motion of at least {LEAST_TRAVEL:g} rad and {FEWEST_STEPS} steps"
            " of the encoder; the position stands still; record richer motion"
        )
    if not pulled:
        raise IdentificationError(
            f"{joint}: excitation too poor: the hand's torque is 0 throughout, so that {NAMES[0]} cannot be determined;"
            " pull at the joint while it moves"
        )
    table = np.concatenate(parts)
    return table[:, :4], table[:, 4], tuple(len(part) for part in parts)


def _travel(position: FloatArray) -> float:
    """How far the joint moves [rad]; 0 if it is less than a few steps of its encoder."""
    steps = np.abs(np.diff(position))
    smallest = float(steps[steps > 0.0].min(initial=np.inf))
    travel = float(np.ptp(position))
    return travel if travel >= FEWEST_STEPS * smallest else 0.0


def _numbers(x: FloatArray, sheet: VoltageMotor) -> FloatArray:
    """f(x) (4,): K, K F_v, K tau_co, K J."""
    constant, resistance, inertia = np.exp(x[:3])
    ratio, emf = sheet.gear_ratio, sheet.back_emf / sheet.torque_constant
    gain = resistance / (constant * ratio)
    return np.array([gain, gain * x[4] + emf * constant * ratio, gain * x[3], gain * inertia * ratio**2])


def _with_prior(joint: str, fit: LinearFit, sheet: VoltageMotor, widths: PriorWidths) -> MotorFit:
    z = np.asarray(fit.coefficients)
    if not np.all(z[[0, 1, 3]] > 0.0):
        told = ", ".join(f"{name}: {value:.4g}" for name, value in zip(NAMES, z, strict=True) if value <= 0.0)
        raise IdentificationError(f"{joint}: expected positive numbers; the logs give {told}")
    covariance = np.asarray(fit.hac_covariance) + np.diag((widths.model * z) ** 2)
    white = np.linalg.inv(np.linalg.cholesky(covariance))
    logs = np.log([sheet.torque_constant, sheet.resistance, sheet.rotor_inertia])
    prior = np.array([*logs, sheet.coulomb, sheet.viscous])
    width = np.array([getattr(widths, name) for name in UNKNOWNS])

    def residual(x: FloatArray) -> FloatArray:
        return np.concatenate([white @ (z - _numbers(x, sheet)), (x - prior) / width])

    lower = np.array([-np.inf, -np.inf, -np.inf, 0.0, 0.0])
    start = np.maximum(prior, lower + 1e-9)
    found = nonlinear_least_squares(residual, start, bounds=(lower, np.full(5, np.inf)), x_scale=width)
    posterior = np.linalg.inv(found.jac.T @ found.jac)
    deviation = np.sqrt(np.diag(posterior))
    values = np.array([*np.exp(found.x[:3]), *found.x[3:]])
    low, high = found.x - CI95 * deviation, found.x + CI95 * deviation
    low, high = (np.array([*np.exp(side[:3]), *np.maximum(side[3:], 0.0)]) for side in (low, high))
    emf = sheet.back_emf / sheet.torque_constant
    named = dict(zip(UNKNOWNS, map(float, values), strict=True))
    motor = VoltageMotor(
        **named,
        back_emf=emf * named["torque_constant"],
        gear_ratio=sheet.gear_ratio,
        stiffness=sheet.stiffness,
        voltage_limit=sheet.voltage_limit,
    )
    spread = {name: (float(a), float(b)) for name, a, b in zip(UNKNOWNS, low, high, strict=True)}
    share = {name: float(1.0 - (d / w) ** 2) for name, d, w in zip(UNKNOWNS, deviation, width, strict=True)}
    pull = dict(zip(UNKNOWNS, map(float, (found.x - prior) / width), strict=True))
    return MotorFit(
        joint, motor, spread, share, pull, 2.0 * float(found.cost), fit, _doubts(joint, pull, sheet, widths)
    )


def _doubts(joint: str, pull: dict[str, float], sheet: VoltageMotor, widths: PriorWidths) -> tuple[str, ...]:
    """What does not fit.

    Raises:
        IdentificationError: an unknown that is beyond any doubt.
    """
    far = {name: value for name, value in pull.items() if abs(value) > DOUBTFUL}
    told = ", ".join(f"{name} is {value:+.1f} deviations off the data sheet" for name, value in far.items())
    if any(abs(value) > CONTRADICTION for value in far.values()):
        raise IdentificationError(
            f"{joint}: logs and data sheet contradict each other: {told}; check gear_ratio and the other numbers of the"
            " sheet and the units of the logs, or widen `widths` in the sheet"
        )
    notes = [f"{joint}: {told}: the sheet, its gear_ratio or the logs' units may not fit"] if far else []
    ratio = sheet.back_emf / sheet.torque_constant
    if abs(np.log(ratio)) > widths.torque_constant:
        notes.append(
            f"{joint}: the data sheet's back_emf is {ratio:.3g} of its torque_constant; in SI they are equal for an"
            " ideal motor, and the fit keeps their ratio"
        )
    return tuple(notes)


ALL = "all"
"""Stands for every joint that the file does not name."""


@dataclass(frozen=True)
class MotorSheet:
    """What a file says of motors before they are measured.

    Attributes:
        source: The file.
        motors: Joint, or `ALL`, to motor.
        widths: How far they may be off.
    """

    source: Path
    motors: Mapping[str, VoltageMotor]
    widths: PriorWidths = field(default_factory=PriorWidths)

    def __post_init__(self) -> None:
        if not self.motors:
            raise ParamsError(f"motors: expected a mapping of joint, or {ALL!r}, to a motor, got none")

    def motor(self, joint: str) -> VoltageMotor:
        """The motor of a joint.

        Raises:
            ParamsError: the file has neither the joint nor `ALL`.
        """
        found = self.motors.get(joint, self.motors.get(ALL))
        if found is None:
            raise ParamsError(
                f"{self.source}: motors: no motor of joint {joint!r}, nor {ALL!r}; there: {', '.join(self.motors)}"
            )
        return found


def load_motor_sheet(path: Path) -> MotorSheet:
    """Read a data sheet.

        motors:
          all: {torque_constant: 0.043, back_emf: 0.043, resistance: 0.55, rotor_inertia: 1.0e-5, gear_ratio: 100.0,
                coulomb: 1.0, viscous: 1.0, stiffness: 200.0, voltage_limit: 24.0}
          r_elbow: {...}                                   # in place of `all`, whole
        widths: {torque_constant: 0.1}                     # optional: fields of `PriorWidths`

    Args:
        path: The file; a motor's fields are those of `VoltageMotor`, SI, `voltage_limit` optional.

    Raises:
        ParamsError: the file cannot be read, a field is unknown or missing, or a value is not possible.
    """
    return read_record(MotorSheet, read_yaml(path, "data sheet"), str(path), more={"source": path})
