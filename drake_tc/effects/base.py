"""What an effect is: one physical cause, written once, used four ways.

Every effect takes part in the torque balance of one geared joint (Del Prete et al., 2016, eq. 6; Faraji et al., 2015,
section II.A). It is written *forward*: the torque that the drive delivers, against the torque that the motion and the
load need.

    y*/K = tau + J qddot + sum_k theta_k phi_k(signals; shape)                                  (balance)

    y    commanded effort of the drive: q_d - q [rad], current [A], voltage [V] or commanded torque [N m]
    y*   effort that the drive acted on: y after dead zone, delay, lag, saturation ... (`DriveEffect.transform`)
    K    drive gain [effort/(N m)]: K_tau of a position servo, 1/K1 of a current drive, Rm/(kt N) of a voltage drive,
         1 of a torque drive whose torque is the commanded one
    tau  load torque on the link side [N m]; J: declared reflected rotor inertia [kg m^2]
    phi_k, theta_k   an effect's columns and coefficients [N m = unit(phi) unit(theta)]

Forward, because then a drive effect is a function of the clean command on the regressor's side and cannot
explain the target by shrinking it. Columns are *elementwise*: the same function is evaluated on the samples of a
log (identification, diagnosis) and on the joints of a robot at one instant (simulation, compensation).
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, replace
from functools import cache
from types import MappingProxyType
from typing import Any, ClassVar, Literal

import numpy as np

from drake_tc.config.joint_units import EFFORT_UNIT, JointType
from drake_tc.effects.context import Context, DriveKind, JointNumbers, Obstacle, Parameter, Plausible, Values
from drake_tc.effects.kernel import DriveKernel, EquationKernel, InverseLaw, TorqueKernel, TorqueParts, Transmission
from drake_tc.kernels.torque_equations import EQUATIONS, JointState
from drake_tc.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Signals:
    """What an effect may look at; every array (T,): samples of one joint's log, or joints at one instant.

    Attributes:
        time: Since the start of the run [s].
        position, velocity, acceleration: q, qdot, qddot [rad, rad/s, rad/s^2].
        load_torque: tau on the link side [N m].
        expected_torque: tau as the model so far expects it [N m], without the errors of sensors that it tells.
        slow_torque: tau low-passed three times as hard [N m], for effects that differentiate it: the sensor's noise,
            differentiated, would explain itself. The same as `load_torque` where nothing was filtered.
        effort: y, the commanded effort of the drive [rad | A | V | N m].
        command: The recorded command itself: q_d [rad], i [A], V [V] or tau_d [N m].
        direction: sign of the last resolved motion, in [-1, 1]; between them while it turns over.
        travel: distance moved since the last reversal [rad], >= 0.
        load_slope: d tau / d q of a load that is computed from the position (m g l cos q) [N m/rad], or 0.
        supply_voltage: Voltage that feeds the drive [V], NaN where not recorded; 0 counts as not known.
        known_torque: Torque of effects whose values the owner declares [N m].
        temperature: [deg C], NaN where it was not recorded.
        motor_position: Motor-side position over the gear ratio [rad], NaN where not recorded.
        rotor_inertia: The declared J [kg m^2], 0 where none was declared.
        link_inertia: Of a load that is computed from the position (a pendulum's, about the axis) [kg m^2], or 0.
        viscous: The current model's viscous coefficient [N m s/rad], for sensor errors that act through it.
        stiffness: The current model's 1/K of a position servo [N m/rad]; 0 for other drives.
        period: Sampling period [s]; 0 for an instant.
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    load_torque: FloatArray
    expected_torque: FloatArray
    slow_torque: FloatArray
    effort: FloatArray
    command: FloatArray
    direction: FloatArray
    travel: FloatArray
    load_slope: FloatArray
    temperature: FloatArray
    motor_position: FloatArray
    supply_voltage: FloatArray
    known_torque: FloatArray
    rotor_inertia: float = 0.0
    link_inertia: float = 0.0
    viscous: float = 0.0
    stiffness: float = 0.0
    period: float = 0.0

    def __len__(self) -> int:
        return int(self.position.size)

    def has(self, name: str) -> bool:
        """Whether the signal `name` was recorded at all (an unrecorded one is all NaN)."""
        return bool(np.isfinite(getattr(self, name)).any())

    def take(self, index: BoolArray | IntArray | slice) -> "Signals":
        """The same signals at the samples `index`."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        changed: dict[str, Any] = {name: v[index] for name, v in values.items() if isinstance(v, np.ndarray)}
        return replace(self, **changed)

    def lazily(self, change: Callable[[FloatArray], FloatArray]) -> "Signals":
        """The signals with every array changed. An array is computed when it is first read: most effects read few.

        Args:
            change: (T,) to (S,); S is the same for all arrays.
        """
        made = object.__new__(Signals)
        made.__dict__.update({name: getattr(self, name) for name in _numbers()})
        made.__dict__["_unread"] = (self, change)
        return made

    def __getattr__(self, name: str) -> FloatArray:
        """An array of `lazily` that has not been read."""
        if name.startswith("_") or "_unread" not in self.__dict__:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        whole, change = self.__dict__["_unread"]
        return self.__dict__.setdefault(name, change(getattr(whole, name)))  # type: ignore[no-any-return]


@cache
def _numbers() -> tuple[str, ...]:
    """The fields that are no arrays."""
    return tuple(f.name for f in fields(Signals) if f.default is not MISSING)


def plain_signals(size: int, known: Mapping[str, FloatArray]) -> Signals:
    """Signals (size,) of which only some are known; all others are 0."""
    nil: dict[str, Any] = {f.name: np.zeros(size) for f in fields(Signals) if f.default is MISSING}
    return Signals(**(nil | dict(known)))


__all__ = [
    "EFFORT_UNIT",
    "Context",
    "DriveEffect",
    "DriveKind",
    "Effect",
    "JointNumbers",
    "Parameter",
    "Plausible",
    "SensorEffect",
    "Shape",
    "Signals",
    "Signature",
    "TorqueEffect",
    "TransmissionEffect",
    "Values",
    "plain_signals",
]


@dataclass(frozen=True)
class Signature:
    """The plot in which an engineer sees the effect: the residual against `x`, split by `split`.

    Attributes:
        x: A `Signals` field, or "position modulo <period>" with the period taken from the shape.
        split: "direction" to draw the two directions of motion apart, or "".
        look_for: One sentence: what the eye should find.
    """

    x: str
    split: str
    look_for: str


Shape = Mapping[str, float]


class Effect(ABC):
    """One physical cause. Subclasses add the equation; an instance carries no data.

    An effect's parameters are split into *coefficients*, in which the balance is linear (theta), and a *shape*, in
    which it is not (a Stribeck velocity, a ripple's frequency). `coefficients` and `shapes` name them in order.
    `form` tells apart the forms that one cause can take (a delay of the command or of the whole loop) under one `id`.
    """

    id: ClassVar[str]
    title: ClassVar[str]
    kind: ClassVar[Literal["friction", "load", "drive", "transmission", "sensor"]]
    form: ClassVar[str] = ""
    coefficients: ClassVar[tuple[Parameter, ...]] = ()
    shapes: ClassVar[tuple[Parameter, ...]] = ()
    given_shapes: ClassVar[tuple[Parameter, ...]] = ()
    """Shape parameters that `shape_grid` takes from the range of the log; they are reported, but no fit moves them."""
    equation: ClassVar[str] = ""
    """The effect in the names of its `parameters` and of signals (`drake_tc.report.equation`): a report fills it in.
    Several equations are separated by ";". `tau_add` is the torque that the effect costs between drive and link."""
    signature: ClassVar[Signature]
    size: ClassVar[tuple[str, str] | None] = None
    """Name and unit of the number that tells how strong the effect is, where this is not its first parameter."""
    needs: ClassVar[frozenset[str]] = frozenset()
    isolated_by: ClassVar[str] = ""
    """The experiment that shows this effect alone, as an instruction ("let the free joint spin down")."""
    depends_on_position: ClassVar[bool] = False
    """Whether the effect depends on where the joint is, and not on how it moves alone."""
    joint_types: ClassVar[frozenset[JointType]] = frozenset(("revolute", "prismatic"))
    """Types of joints that can have the effect."""
    linear: ClassVar[bool] = False
    """Columns are linear (or nearly so) in the signals: what low-passed the signals has low-passed the columns."""
    unknown_start: ClassVar[bool] = False
    """Whether no channel tells the state in which a run begins, which adds a constant to the effort of that run."""
    ages_of: ClassVar[Mapping[str, float]] = MappingProxyType({})
    """Channels of the log ("command", "effort", "inside", "torque") that a delay makes older than usual, by its share:
    what makes the position late makes all others early."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """What model files and reports call the effect's numbers; coefficients and shape unless a subclass converts."""
        return self.coefficients + self.shapes + self.given_shapes

    @property
    def key(self) -> str:
        """`id`, or `id.form` where the effect has several forms."""
        return f"{self.id}.{self.form}" if self.form else self.id

    def obstacle(self, context: Context) -> str:
        """Why this effect cannot be looked for on such a rig, in a few words; empty when it can."""
        return ""

    def unexcited(self, context: Context) -> str:
        """What changes too little in these logs to show this effect, in a few words; empty when nothing does."""
        return ""

    def unavailable(self, context: Context) -> Obstacle | None:
        """What stands in the way of looking for this effect: the rig, a missing signal, or one that hardly changes."""
        if context.joint_type not in self.joint_types:
            return Obstacle("cannot_be_looked_for", f"the joint is {context.joint_type}")
        if self.depends_on_position and not context.position_recorded:
            statement = "the position was not recorded, and the integral of the velocity has no known zero"
            return Obstacle("not_recorded", statement)
        if statement := self.obstacle(context):
            return Obstacle("cannot_be_looked_for", statement)
        if missing := sorted(self.needs - context.recorded):
            return Obstacle("not_recorded", f"{', '.join(missing)} not recorded")
        if statement := self.unexcited(context):
            return Obstacle("not_excited", statement)
        if not self.shape_grid(context):
            return Obstacle("not_excited", "the recorded motion covers too small a range for this effect")
        return None

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Starting points for the shape parameters, coarse but covering; the search refines the best ones."""
        return [{p.name: p.default for p in (*self.shapes, *self.given_shapes)}]

    @abstractmethod
    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi of (balance), (T, len(coefficients)): the torque the motor must supply per unit coefficient."""

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """Reported parameters by name, from the coefficients, the shape and the drive gain K [effort/(N m)]."""
        named = dict(zip((p.name for p in self.coefficients), map(float, theta), strict=True))
        return named | {p.name: float(shape[p.name]) for p in (*self.shapes, *self.given_shapes)}

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """Why these values are not possible together, in one sentence; empty when they are.

        The range of each parameter alone is its `Parameter.plausible`; this is for what two of them, or a parameter
        and the range of the log, say together. `drake_tc.effects.check.implausible` asks for both.
        """
        return ""

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """Size from which on the effect matters to the user of a model, in the effect's own unit.

        A tenth of the joint's own friction, 5 % of its largest torque (where nothing else is said), or a delay of 3 ms.
        """
        return n.part

    def unit_coefficients(self, n: JointNumbers) -> tuple[FloatArray, ...]:
        """Coefficients theta (k,) of size 1: one for each phase or place that the effect may have, all equally likely.

        Empty for an effect whose size is a shape parameter.
        """
        return tuple(np.eye(len(self.coefficients)))

    @property
    def degrees_of_freedom(self) -> int:
        """Number of parameters that a fit with the effect has beyond one without it."""
        return len(self.coefficients) + len(self.shapes)

    def drive_gain(self, gain: float, shape: Shape) -> float:
        """Drive gain [effort/(N m)] of a model with the effect, from that of the fit."""
        return gain

    def balance_inertia(self, theta: FloatArray, shape: Shape, rotor_inertia: float) -> float:
        """What the effect adds to the coefficient of qddot [kg m^2]: more encoder noise comes through."""
        return 0.0

    def torque_scale(self, theta: FloatArray, shape: Shape) -> float:
        """What one N m of the fitted balance is in true torque; not 1 where the effect scales the balance."""
        return 1.0


class TorqueEffect(Effect):
    """An effect that costs torque between drive and link: friction, inertia, ripple, springs."""

    inertia_parameter: ClassVar[str] = ""
    """Name of the parameter that is an inertia [kg m^2]; empty where the effect has none."""

    def torque(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> FloatArray:
        """sum_k theta_k phi_k (T,): over a log, and for compensation; parameters may be one value a joint."""
        shape = {p.name: parameters[p.name] for p in (*self.shapes, *self.given_shapes)}
        columns = self.columns(signals, shape)  # type: ignore[arg-type]
        theta = np.stack([np.broadcast_to(parameters[p.name], len(signals)) for p in self.coefficients], axis=-1)
        return np.asarray(np.sum(columns * theta, axis=-1))

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """`torque` without its inertial part, at one joint and one instant: see `drake_tc.effects.kernel`.

        This default evaluates `columns`: right for any effect without hysteresis, but slow, so effects override it.
        """

        def parts(*instant: float) -> TorqueParts:
            s = JointState(*instant)
            now = {
                "position": s.q,
                "velocity": s.v,
                "load_torque": s.tau,
                "expected_torque": s.tau,
                "slow_torque": s.tau,
                "temperature": s.celsius,
            }
            known = {name: np.full(2, value) for name, value in now.items()}
            both = plain_signals(2, known | {"direction": np.array([1.0, -1.0]), "travel": np.full(2, np.inf)})
            forth, back = self.torque(both, parameters)
            return 0.5 * float(forth - back), 0.0, 0.5 * float(forth + back)

        return parts

    def inertia(self, parameters: Mapping[str, float]) -> float:
        """Inertia [kg m^2] that the effect adds to the joint: the coefficient of the acceleration in `columns`."""
        return parameters[self.inertia_parameter] if self.inertia_parameter else 0.0

    def hysteresis_travel(self, parameters: Mapping[str, float]) -> float:
        """Travel [rad] over which the effect's own hysteretic state turns over; 0 where it has none."""
        return 0.0


class DriveEffect(Effect):
    """An effect between the command and the drive's torque: y* = transform(y), causal, with memory where it has some.

    `kernel` is the same map one sample at a time. An effect that is looked for as a column acts on the raw effort y,
    in parallel with those that transform it, and its kernel adds that part.
    """

    acts_on: ClassVar[Literal["effort", "command"]] = "effort"
    filters: ClassVar[bool] = False
    """Whether `transform` is a linear filter of the effort: it then lets less of the effort's white noise through."""

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """No torque column: the effect acts through `transform`."""
        return np.zeros((len(signals), 0))

    @abstractmethod
    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """y* over a whole uniform stretch of log, (T,) to (T,)."""

    def undone(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """The effort (T,) of which y* is `effort`: exact where `transform` adds what does not depend on it."""
        return 2.0 * effort - self.transform(effort, signals, shape)

    @abstractmethod
    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """One joint sampled at `period` [s], one sample at a time."""

    def inverse(
        self, effort: FloatArray, position: FloatArray, direction: FloatArray, parameters: Values
    ) -> FloatArray:
        """The effort to ask for so that y* is `effort`, where that is possible; otherwise `effort` itself."""
        return effort

    def inverse_law(self, parameters: Mapping[str, float], smoothing: float) -> InverseLaw | None:
        """`inverse` at one joint and one instant; None where the effect has none.

        Args:
            parameters: By name.
            smoothing: A jump at zero effort becomes a straight line within +/- this effort.
        """
        if type(self).inverse is DriveEffect.inverse:
            return None

        def invert(effort: float, q: float, direction: float) -> float:
            return float(self.inverse(np.array([effort]), np.array([q]), np.array([direction]), parameters)[0])

        return InverseLaw(invert)


class SensorEffect(Effect):
    """An error of a sensor. `columns` is the torque by which it unbalances the joint; `corrupt` is what it does."""

    @abstractmethod
    def corrupt(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """What the sensors would have recorded: true signals in, measured signals out."""

    @abstractmethod
    def restore(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """The inverse of `corrupt`: measured signals in, true signals out."""


class TransmissionEffect(Effect):
    """Play or softness between the motor and the link: the actuator gets a motor inertia of its own."""

    @abstractmethod
    def transmission(self, parameters: Mapping[str, float]) -> Transmission:
        """Gap and compliance of this effect alone."""

    def transmitted(self, twist: FloatArray, parameters: Mapping[str, float]) -> FloatArray:
        """Torque (n,) [N m] that passes the gear when the motor leads the link by `twist` (n,) [rad]."""
        gear = self.transmission(parameters)
        pressed = np.sign(twist) * np.maximum(np.abs(twist) - gear.half_gap, 0.0)
        return np.asarray(pressed / gear.compliance)

    def twist(self, torque: FloatArray, parameters: Mapping[str, float]) -> FloatArray:
        """Lead (n,) [rad] of the motor over the link when the gear passes `torque` (n,) [N m], on the loaded side."""
        gear = self.transmission(parameters)
        return np.asarray(torque * gear.compliance + gear.half_gap * np.sign(torque))


class EquationEffect(TorqueEffect):
    """A torque effect with one equation for fit, simulation and compensation, which the last two run compiled.

    A subclass names the equation and, where these are not its parameters in their order, the equation's numbers.
    """

    torque_kind: ClassVar[int]
    """Kind of the equation (`drake_tc.kernels.torque_equations`)."""

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """The equation's numbers n from the parameters; each may be an array."""
        return tuple(parameters[p.name] for p in self.parameters)

    def hysteresis(self, signals: Signals, shape: Shape) -> FloatArray | float:
        """The effect's own hysteretic state in [-1, 1] over a log (T,); 0 where it has none."""
        return 0.0

    def kernel(self, parameters: Mapping[str, float]) -> EquationKernel:
        """The equation at one joint and one instant."""
        return EquationKernel(self.torque_kind, tuple(map(float, self.numbers(parameters))))

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, k): the equation for one unit of each coefficient."""
        units = np.eye(len(self.coefficients))[:, :, None]
        each = dict(zip((p.name for p in self.coefficients), units, strict=True)) | dict(shape)
        rows = self._torques(signals, each, len(units), self.hysteresis(signals, shape))
        return np.ascontiguousarray(rows.T)

    def equation_torque(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> FloatArray:
        """The equation's torque (T,) for the values of `parameters`, of an effect that is fitted by other coefficients.

        It holds J qddot. Each parameter may be one value a joint (T,).
        """
        return np.asarray(self._torques(signals, parameters, 1, 0.0)[0])

    def _torques(
        self, signals: Signals, parameters: Mapping[str, Any], count: int, hysteresis: FloatArray | float
    ) -> FloatArray:
        """(count, T) of parameters that are numbers, (count, 1) or (T,)."""
        q, v, direction, tau = signals.position, signals.velocity, signals.direction, signals.load_torque
        now = JointState(q, v, direction, tau, signals.temperature, hysteresis)
        level, damping, rest = EQUATIONS[self.torque_kind](now, self.numbers(parameters))
        total, inertia = np.zeros((count, len(signals))), self.inertia(parameters)
        for part, signal in ((level, direction), (damping, v), (rest, 1.0), (inertia, signals.acceleration)):
            if np.ndim(part) or part:
                total += part * signal
        return total
