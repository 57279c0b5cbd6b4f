"""`CommandGuard`: the last stage before the drives; what leaves it is finite and close to where the joints are.

The law of the CommandGuard: bumpless start, limits, hold, damp; one tick as a plain function of state and inputs.

`SensorLossStop`: a joint has lost two of its three sensors for good; torques fade, and the motors brake the fall.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from drake_tc.actuation.compensator import rated_effort
from drake_tc.actuation.model import ActuatorModel
from drake_tc.array_stage import Arrays, ArrayStage, StageSystem, places
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import COPY_BELOW, GUARD, Kernel, KernelCall, copying
from drake_tc.types import BoolArray, Call, FloatArray

_STEP = Kernel("guard", "step")
OFFSET = 0.2
"""Of a servo's command from its joint where nothing is known of the drives [rad]."""
RATE = 20.0
"""Of a servo's command where no other rate is stated [rad/s]."""
START = 0.5
"""Duration of the start where no other is stated [s]."""
RISE = 0.01
"""Time in which another drive's command may then go from 0 to its largest value [s]: a servo's goes `OFFSET` in it."""
UNBOUNDED = 1e9
"""The same of another drive whose joint has no rated torque [A | V | N m]."""


class GuardMode(IntEnum):
    """What the guard is doing."""

    START = 0
    NORMAL = 1
    HOLD = 2
    DAMP = 3


@dataclass(frozen=True)
class GuardSpec:
    """Limits and times of the guard.

    Attributes:
        offset_limit: |q_d - q| of a position servo, |y| of other drives; one number or one a joint, > 0
            [rad | A | V | N m]. None: in a torque loop what each drive needs for its joint's rated torque at full
            speed, elsewhere `OFFSET` for servos and no limit for other drives.
        rate_limit: Of the command, likewise, > 0 [1/s]. At least what the joint itself can do, or the command cannot
            follow a joint that is pushed. None: `RATE` for servos, from 0 to the offset limit in `RISE` for other
            drives.
        start_time: From the position at the first tick (0 for other drives) to the incoming command [s]. None: `START`
            with a servo; `RISE` where no drive is one, as joints without torque would fall meanwhile.
        start_rate: A servo's command is no faster than this until it has met the incoming one, at the start as after a
            fault, while which the reference may have gone on, > 0 [rad/s]. Other drives take `rate_limit`.
        hold_time: How long the last safe command is held after a fault [s].
        damp_time: Time constant with which the command then goes to the position (to 0 for other drives), > 0 [s].
            The drive feels like a damper of Kd = damp_time/K_tau.
        damp_rate: And its largest rate, > 0 [1/s].
        recover_time: How long inputs must be sound before they count again [s].
        blend_time: From the held to the incoming command, then [s].

    Raises:
        ParamsError: a number that is not possible.

    Example:
        >>> TorqueLoopSpec(guard=GuardSpec(offset_limit=0.1)).guard.offset_limit
        0.1
    """

    offset_limit: float | tuple[float, ...] | None = None
    rate_limit: float | tuple[float, ...] | None = None
    start_time: float | None = None
    start_rate: float = 1.0
    hold_time: float = 0.1
    damp_time: float = 0.1
    damp_rate: float = 0.5
    recover_time: float = 0.02
    blend_time: float = 0.1

    def __post_init__(self) -> None:
        for part in fields(self):
            if getattr(self, part.name) is None:
                continue
            value = np.asarray(getattr(self, part.name), dtype=np.float64)
            strict = not part.name.endswith("_time") or part.name == "damp_time"
            if not np.all(np.isfinite(value) & ((value > 0.0) if strict else (value >= 0.0))):
                bound = "> 0" if strict else ">= 0"
                raise ParamsError(
                    f"guard.{part.name}: expected finite numbers {bound}, got {getattr(self, part.name)!r}"
                )

    def time_to_start(self, servo: Collection[bool]) -> float:
        """`start_time` of these drives [s].

        Args:
            servo: (n,) whether a drive is a position servo.
        """
        if self.start_time is not None:
            return self.start_time
        return START if any(servo) else RISE


def rated_guard(
    spec: GuardSpec, models: Sequence[ActuatorModel], effort: FloatArray, velocity: FloatArray
) -> GuardSpec:
    """The spec, with the offset limit that each drive needs for its joint's rated torque where it states none.

    Args:
        spec: Limits and times.
        models: One a joint.
        effort: (n,) largest torque of the joints [N m]; infinite where it is not known.
        velocity: (n,) their largest speed [rad/s]; infinite where it is not known.
    """
    if spec.offset_limit is not None:
        return spec
    rated = map(rated_effort, models, effort.tolist(), velocity.tolist())
    widest = (OFFSET if model.drive.kind == "position_servo" else UNBOUNDED for model in models)
    return replace(spec, offset_limit=tuple(map(min, rated, widest)))


class GuardLaw:
    """x[n+1] = step(x[n], command, position, fault): see `drake_tc.control.guard.CommandGuard`. Holds no changing data.

    x = [y (n), last finite position (n), anchor (n), mode, time in hold and damp, time sound, s, 1/T], 1/T = 0 before
    the first tick; in normal mode the anchor is the y before the last.

    Attributes:
        limits: (4, n) offset limit, largest step, that of the start, and 1 for a position servo, 0 for another drive.
    """

    def __init__(self, size: int, dt: float, spec: GuardSpec, servo: tuple[bool, ...] | None = None) -> None:
        """Spread the limits over the joints.

        Raises:
            ParamsError: sizes that do not agree.
        """
        flags = (True,) * size if servo is None else tuple(servo)
        if len(flags) != size:
            raise ParamsError(f"servo: expected {size} flags, one a joint, got {len(flags)}")
        self._size = size
        servos = np.array(flags)
        widest = self._spread("offset_limit", spec.offset_limit, np.where(servos, OFFSET, UNBOUNDED))
        step = dt * self._spread("rate_limit", spec.rate_limit, np.where(servos, RATE, widest / RISE))
        start_step = np.where(servos, np.minimum(step, dt * spec.start_rate), step)
        self.limits: FloatArray = np.stack([widest, step, start_step, servos.astype(np.float64)])
        times = (
            spec.time_to_start(flags),
            spec.hold_time,
            spec.damp_time,
            spec.damp_rate,
            spec.recover_time,
            spec.blend_time,
        )
        self._options = np.array([dt, *times])

    def _spread(self, name: str, value: float | tuple[float, ...] | None, default: FloatArray) -> FloatArray:
        array = default if value is None else np.asarray(value, dtype=np.float64)
        if array.shape not in ((), (self._size,)):
            raise ParamsError(f"guard.{name}: expected one number or {self._size}, got {array.size}")
        return np.full(self._size, array)

    def initial(self) -> FloatArray:
        """State before the first tick."""
        return np.append(np.zeros(3 * self._size), [float(GuardMode.HOLD), 0.0, 0.0, 0.0, 0.0])

    def step(
        self, state: FloatArray, command: FloatArray, position: FloatArray, fault: float, after: FloatArray
    ) -> None:
        """One tick: the next state into `after`, whose first n numbers are the outgoing command."""
        _STEP(state, (command, position, fault), self.limits, self._options, after)

    def bind(
        self, state: FloatArray, command: FloatArray, position: FloatArray, fault: FloatArray, after: FloatArray
    ) -> KernelCall:
        """`step` on arrays that stay the same objects, as a function of the time [s]; fault (1,)."""

        def outputs(time: float) -> None:
            self.step(state, command, position, fault[0], after)

        return KernelCall(GUARD, outputs, state, command, position, fault, self.limits, self._options, after)


class CommandGuard(StageSystem):
    """Bumpless start, limits, and a safe reaction to lost signals: hold, then damp.

    r is where a drive is at rest: the position for a position servo, 0 for others. Every tick, with D the offset limit
    and R the rate limit,

        wish   = anchor + w (command - anchor)            start: w = 3 s^2 - 2 s^3 grows from 0 to 1, s += dt/T
                 command                                  normal
                 y[n-1]                                   hold; after normal y[n-2]: a flag may be a tick late
                 y[n-1] + clip((r - y[n-1]) dt/damp_time, +/- damp_rate dt)     damp
        y[n]   = clip(clip(wish, r - D, r + D), y[n-1] - R dt, y[n-1] + R dt)

    so that |y[n] - y[n-1]| <= R dt always, and |y[n] - r| <= D as long as the joint itself is not faster than R. In
    the start R is at most `start_rate` (servos), and the start ends when s is 1 and the command is within that rate: a
    joint that was left behind catches up at a walk. The first tick has no y[n-1]: it starts at r.

    Inputs are sound when all of them are finite and `fault` is 0. At the first tick that is not, hold; `hold_time`
    later, damp; once sound for `recover_time`, start again from y (anchor = y, T = blend_time). A joint whose position
    is lost takes the last finite one; in damping it holds on, for a drive that followed a wrong position would drag its
    joint along. With `fault` 2 all positions are lost. Before the first finite position of a servo, y is 0 and the mode
    is hold.

    Inputs:
        command (n): q_d [rad], i [A] or V [V].
        position (n): q as the encoders read it now [rad].
        fault (1): 0 while upstream is sound, 1 where it is not, 2 where the positions are wrong too.
    Outputs, with direct feedthrough of every input:
        command (n): y[n], finite whatever comes in.
        mode (1): a GuardMode.
        next (3n + 5): the state of the next tick, of which y[n] and the mode are parts.
    State: y[n-1] (n), last finite position (n), anchor (n), mode, time in hold and damp, time sound, s, 1/T (0: no tick
    yet).

    Example:
        >>> guard = CommandGuard(6, 1e-3, GuardSpec(offset_limit=0.1))
        >>> guard.get_command_output_port().size()
        6
    """

    def __init__(
        self, size: int, dt: float, spec: GuardSpec | None = None, servo: tuple[bool, ...] | None = None
    ) -> None:
        """Declare ports and state.

        Args:
            size: Joints n.
            dt: Period [s].
            spec: Limits and times; None: the defaults.
            servo: (n,) whether a joint's drive is a position servo; None: all are.

        Raises:
            ParamsError: sizes that do not agree, or a period that is not possible.
        """
        super().__init__()
        spec = GuardSpec() if spec is None else spec
        if size < 1:
            raise ParamsError(f"CommandGuard: expected at least one joint, got {size}")
        if not (np.isfinite(dt) and dt > 0.0):
            raise ParamsError(f"dt: expected a positive period [s], got {dt!r}")
        self._law = GuardLaw(size, float(dt), spec, servo)
        self._size, self._dt = size, float(dt)
        self._declare({"command": size, "position": size, "fault": 1})

    def coordinates(self, context: Context) -> FloatArray:
        """(n,) y[n-1], all that is state in the normal mode (`drake_tc.analysis`).

        Raises:
            ParamsError: another mode, in which the guard is about to change its law.
        """
        self.ValidateContext(context)
        memory = context.get_discrete_state(self._memory).value()
        mode = GuardMode(int(memory[3 * self._size]))
        if mode != GuardMode.NORMAL:
            raise ParamsError(
                f"guard {self.get_name()!r}: expected the normal mode, to linearise; it is in {mode.name.lower()}:"
                " give the loop time to start"
            )
        return np.array(memory[: self._size])

    def set_coordinates(self, context: Context, x: FloatArray) -> None:
        """Make y[n-1] (n,) x."""
        self.ValidateContext(context)
        memory: Any = np.array(context.get_discrete_state(self._memory).value())
        memory[: self._size] = x
        context.SetDiscreteState(self._memory, memory)

    def coordinate_names(self) -> tuple[str, ...]:
        """Of `coordinates`: "command[i]" is that of the tick before."""
        return tuple(f"command[{i}]" for i in range(self._size))

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        n, start = self._size, self._law.initial()

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            out, after = arrays.out, arrays.after
            command, position, fault = (arrays.inputs[name] for name in ("command", "position", "fault"))

            return self._law.bind(arrays.before, command, position, fault, out), copying(out, after)

        parts = {"command": slice(n), "mode": slice(3 * n, 3 * n + 1), "next": slice(start.size)}
        reads = frozenset({"command", "position", "fault"})
        return ArrayStage(start.size, places(parts), bind, reads, start=start, period=self._dt)


LOSS_TIME = 0.15
"""Time for which a flag is up before the joint counts as lost [s]; the flag itself takes 0.1 s of it."""
_ANY = float(np.nextafter(0.0, 1.0))
"""The least number above 0."""


class SensorLossStop(StageSystem):
    """What the controllers get once a joint's `lost` has been up for `LOSS_TIME`, for good.

    Inputs: state (m) of the robot; torque (n) of the gauges; desired (n) torques of the controller; lost (n), by joint.
    Outputs, `state` and `torque` with feedthrough of the inputs of these names, `desired` with that of its own:
        state (m): NaN once a joint is lost that the robot stands on, with which `RobustTsid` fades all torques by
            exp(-t/fade).
        torque (n): faded likewise for all joints then, and for a lost joint that nothing stands on for that one, so
            that torque control sees neither torque nor speed, and asks for no voltage: a motor without voltage brakes
            its joint by its back-EMF.
        desired (n): faded for the lost joints alone, where the robot stands on none of them: an arm that is lost hangs,
            and the robot goes on standing.
    State, by joint: ticks c since `lost` is up, c[n+1] = c[n] + 1 where it is up or c[n] has reached the limit, else 0.
    """

    def __init__(self, size: int, carrying: BoolArray, fade: float, dt: float) -> None:
        """Declare ports, state and the periodic update.

        Args:
            size: m.
            carrying: (n,) which joints the robot stands on.
            fade: Of the torques [s].
            dt: Period [s].
        """
        super().__init__()
        self._limit, self._nothing, self._dt = float(np.ceil(LOSS_TIME / dt)), np.full(size, np.nan), dt
        self._rate, self._carrying = dt / fade, np.array(carrying, dtype=bool)
        joints = self._carrying.size
        self._declare({"state": size, "torque": joints, "desired": joints, "lost": joints})

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        size, n = self._nothing.size, self._carrying.size

        def bind_early(arrays: Arrays) -> tuple[Sequence[Call], None]:
            ticks, known, torque = arrays.before, arrays.inputs["state"], arrays.inputs["torque"]
            state_out, torque_out = arrays.out[:size], arrays.out[size:]

            def tell(time: float) -> None:
                state_out[:] = self._nothing if self._is_lost(ticks) else known

            def fade(time: float) -> None:
                torque_out[:] = self._faded_torque(ticks, torque)

            usual = (ticks, self._limit)
            return (
                KernelCall(COPY_BELOW, tell, known, state_out, *usual),
                KernelCall(COPY_BELOW, fade, torque, torque_out, *usual),
            ), None

        def bind(arrays: Arrays) -> tuple[Call, Sequence[Call]]:
            ticks, desired, lost = arrays.before, arrays.inputs["desired"], arrays.inputs["lost"]
            out, after = arrays.out, arrays.after

            def fade(time: float) -> None:
                out[:] = self._faded_desired(ticks, desired)

            def count(time: float) -> None:
                after[:] = self._next(ticks, lost)

            outputs = KernelCall(COPY_BELOW, fade, desired, out, ticks, self._limit)
            watched = np.zeros(2 * n)
            seen = [copying(ticks, watched[:n]), copying(lost, watched[n:])]
            return outputs, [*seen, KernelCall(COPY_BELOW, count, ticks, after, watched, _ANY)]

        parts = places({"state": slice(size), "torque": slice(size, size + n)})
        early = ArrayStage(size + n, parts, bind_early, frozenset({"state", "torque"}))
        desired, lost = frozenset({"desired"}), frozenset({"lost"})
        ports = places({"desired": slice(n)})
        return ArrayStage(n, ports, bind, desired, lost, start=np.zeros(n), period=self._dt, early=early)

    def _is_lost(self, ticks: FloatArray) -> bool:
        """Whether a joint is lost that the robot stands on."""
        return self._fades(ticks) and bool(np.count_nonzero(ticks[self._carrying] >= self._limit))

    def _fades(self, ticks: FloatArray) -> bool:
        """Whether any joint is lost."""
        return bool(np.count_nonzero(ticks)) and bool(np.count_nonzero(ticks >= self._limit))

    def _faded_torque(self, ticks: FloatArray, torque: FloatArray) -> FloatArray:
        """(n,) the output `torque`."""
        if not self._fades(ticks):
            return torque
        longest = float(ticks[self._carrying].max(initial=0.0))
        return np.asarray(torque * np.exp(-self._rate * np.maximum(np.maximum(ticks, longest) - self._limit, 0.0)))

    def _faded_desired(self, ticks: FloatArray, desired: FloatArray) -> FloatArray:
        """(n,) the output `desired`."""
        if not self._fades(ticks) or self._is_lost(ticks):
            return desired
        return np.asarray(desired * np.exp(-self._rate * np.maximum(ticks - self._limit, 0.0)))

    def _next(self, ticks: FloatArray, lost: FloatArray) -> FloatArray:
        """(n,) c[n+1]."""
        if not (np.count_nonzero(ticks) or np.count_nonzero(lost)):
            return ticks
        return np.where((ticks >= self._limit) | (lost > 0.0), ticks + 1.0, 0.0)
