"""`RunReport`: how a real-time run ended, what went wrong and how often, and how late its ticks were.

`RealTimeLoop`: a controller against wall-clock time. Nothing raises in its loop, and what goes out is finite.

    waiting --(sound readings for arm_time)--> running --(stop)--> stopping --(stop_time)--> stopped

Between the controller and the robot stands a last guard of the library's own (`drake_tc.control.guard.GuardLaw`): it
limits offset and rate of the command whatever the controller is, holds the last command and then damps when readings
are missing, a deadline was missed by too much, the controller failed or returned NaN, and when the loop is stopped.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np

from drake_tc.config.records import Checked, FromZero
from drake_tc.control.guard import GuardLaw, GuardMode, GuardSpec
from drake_tc.errors import ParamsError
from drake_tc.hardware.link import (
    Clock,
    Message,
    WallClock,
    paused_garbage_collection,
    real_time_priority,
    stopping_signals,
    whole_link,
)
from drake_tc.hardware.stepper import ControllerStepper, LatestReadings
from drake_tc.hardware.watch import ModelWatch
from drake_tc.loops.built_loop import Controller
from drake_tc.types import FloatArray

Ending = Literal["duration", "signal", "stop message", "stopped", "no readings"]
"""What ended a run: its duration; a signal; the robot's stop message; `RealTimeLoop.stop`; no sound readings at all."""
SHARES = {"median": 50.0, "p99": 99.0, "p99_9": 99.9, "max": 100.0}
"""Name to percentile."""


@dataclass
class Counts:
    """What happened, in ticks.

    Attributes:
        ticks: Ticks of the controller.
        missed: Ticks that were not done when the next one was due.
        skipped: Ticks that were left out for it.
        late: Ticks without new readings, which took the last ones.
        missing: Ticks whose last readings were older than `max_age`; the stages were told that there are none.
        malformed: Readings with a port that is not there, or of another size; such a port counts as missing.
        held: Ticks in which the last guard, or the one of the controller, held or damped.
        link_errors: Exceptions of the link.
        controller_errors: Exceptions of the controller.
        watch_errors: Exceptions of the watch of the models, which ends with the first one.
    """

    ticks: int = 0
    missed: int = 0
    skipped: int = 0
    late: int = 0
    missing: int = 0
    malformed: int = 0
    held: int = 0
    link_errors: int = 0
    controller_errors: int = 0
    watch_errors: int = 0


@dataclass(frozen=True, eq=False, kw_only=True)
class RunReport:
    """What a real-time run comes to.

    Attributes:
        ended: What ended it.
        seconds: Wall time from the first command to the last [s].
        counts: What happened.
        wake: (T,) how late a tick began after it was due [s].
        work: (T,) how long it took [s].
        last_error: Of link or controller; empty without one.
        flags: Flag of the controller's fault monitor that was up, to the ticks in which it was.
        watch: What was told of the models, where they were watched; see `ModelWatch.to_json`.
    """

    ended: Ending
    seconds: float
    counts: Counts
    wake: FloatArray
    work: FloatArray
    last_error: str = ""
    flags: Mapping[str, int] = field(default_factory=dict)
    period: float = 1e-3
    watch: Mapping[str, Any] | None = None

    @property
    def miss_share(self) -> float:
        """Share of ticks that missed their deadline [-]."""
        return self.counts.missed / max(self.counts.ticks, 1)

    def percentiles(self) -> dict[str, dict[str, float]]:
        """Of `wake` and `work` [s]: median, p99, p99_9, max; NaN without a tick."""
        return {
            name: {
                share: float(np.percentile(times, at)) if times.size else float("nan") for share, at in SHARES.items()
            }
            for name, times in (("wake", self.wake), ("work", self.work))
        }

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        counts = {each.name: getattr(self.counts, each.name) for each in fields(Counts)}
        told = {"ended": self.ended, "seconds": self.seconds, "period": self.period, "last_error": self.last_error}
        return told | {
            "counts": counts,
            "flags": dict(self.flags),
            "miss_share": self.miss_share,
            "times": self.percentiles(),
            "watch": None if self.watch is None else dict(self.watch),
        }


SLIP, DRIFT = 0.05, 1e-4
"""By how much of a period ticks move back where readings come in just behind them, and how much of that is earned back
in a tick: all of it is one period, and then as much as two clocks can drift apart."""
MADE_UP = 10
"""Ticks that are made up after a gap."""
NOT_FINITE = "command/not_finite"
"""Flag of a controller whose stages give what is no number."""
KEPT = 1 << 20
"""Ticks whose times are kept; of a longer run the last ones."""


@dataclass(frozen=True)
class RealTimeSpec(Checked):
    """How a controller runs against wall-clock time.

    Attributes:
        guard: Limits of the last guard. None: those of `GuardSpec`, which are for position servos; other drives need
            an `offset_limit`.
        max_age: Readings that are older are missing [s].
        arm_time: How long readings must be complete, finite and within the joints' ranges before the first command
            goes out [s].
        patience: How long to wait for that [s].
        stop_time: How long the guard holds and damps after a stop, before commands end [s].
        spin: How long before a tick the clock is looked at instead of sleeping [s]; costs a core's time.
        priority: Real-time priority of the process while it runs, from 1 to 99 (SCHED_FIFO); 0: none.
        dry: No command goes out: the controller runs on the robot's readings, and the report tells what it did.

    Raises:
        ParamsError: a time that is not possible.

    Example:
        >>> RealTimeSpec(max_age=0.004).stop_time
        1.0
    """

    guard: GuardSpec | None = None
    max_age: FromZero = 5e-3
    arm_time: FromZero = 0.1
    patience: FromZero = 10.0
    stop_time: FromZero = 1.0
    spin: FromZero = 0.0
    priority: int = 0
    dry: bool = False


@dataclass
class _Tick:
    """What a run knows between two ticks."""

    readings: LatestReadings
    counts: Counts = field(default_factory=Counts)
    last_error: str = ""
    inner: float = 0.0
    """Mode of the controller's own guard, where it has one."""
    flagged: Any = 0
    """(flags) ticks in which each of the controller's flags was up."""
    watch: ModelWatch | None = None
    """None once it has failed."""


class RealTimeLoop:
    """Steps a controller against wall-clock time, between a robot's readings and its commands.

    In each tick: take the newest readings; step the controller; pass its command through the last guard; send it.

    Where nothing new has come in, the last readings stand in for at most `max_age`, positions going on at their last
    speed, after which the stages are told that there are no readings. A tick that is not done when the next one is due
    is counted as a miss. The next one is then at the next multiple of the period, and up to `MADE_UP` ticks in between
    are made up without a command, their positions interpolated, so that the controller's time is that of the clock. A
    gap of more than `max_age` is a fault for the guard.

    The ticks follow the robot's clock: each tick that finds nothing new moves those after it back a little (`SLIP`),
    until readings come in before their ticks.

    An exception of link or controller is counted, its text kept, and the guard holds. Commands are positions within the
    joints' ranges for position servos.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> models = load_models(robot.actuators)
        >>> leg = SimulatedRobot(robot, models)
        >>> link = CallbackLink(leg.read, lambda sent: leg.advance(sent["command"]))
        >>> RealTimeLoop(torque_controller(robot, models, fused=True), link).run(0.2).ended
        'duration'
    """

    def __init__(
        self,
        controller: Controller,
        link: object,
        spec: RealTimeSpec | None = None,
        clock: Clock | None = None,
        watch: ModelWatch | None = None,
    ) -> None:
        """Make the stepper and the guard.

        Args:
            controller: From `torque_controller` or one of its like.
            link: To the robot: a `RobotLink`, or any object with `read` and `write`.
            spec: How it runs; None: the defaults.
            clock: None: the wall clock.
            watch: Of the models of this controller; None: they are not watched.

        Raises:
            ParamsError: drives that are no position servos without an `offset_limit`, or something else than a
                controller or a link.
        """
        if not isinstance(controller, Controller):
            raise ParamsError(
                f"controller: expected what torque_controller and its like return, got {type(controller).__name__}"
            )
        self._spec = RealTimeSpec() if spec is None else spec
        joints = controller.controlled
        guard = GuardSpec() if self._spec.guard is None else self._spec.guard
        if guard.offset_limit is None and not all(joints.servo):
            raise ParamsError(
                "guard: expected limits [N m | A | V] for drives that are no position servos, got none:"
                " RealTimeSpec(guard=GuardSpec(offset_limit=...))"
            )
        self._joints, self._n = joints, len(joints.joints)
        self._link, self._clock = whole_link(link), WallClock(self._spec.spin) if clock is None else clock
        self._watch = watch
        read = ("command", "mode", "flags", *(() if watch is None else watch.signals))
        outputs = [name for name in dict.fromkeys(read) if controller.HasOutputPort(name)]
        names = joints.flag_names
        self._not_finite = names.index(NOT_FINITE) if NOT_FINITE in names else None
        self._stepper = ControllerStepper(controller, joints.period, outputs)
        self._guard = GuardLaw(self._n, joints.period, guard, joints.servo)
        servo = np.array(joints.servo)
        self._range = np.where(servo, joints.lower, -np.inf), np.where(servo, joints.upper, np.inf)
        self._ending: Ending | None = None

    def stop(self, ending: Ending = "stopped") -> None:
        """End the run: the guard holds and damps for `stop_time`, then commands end. May be called from any thread."""
        if self._ending is None:
            self._ending = ending

    def run(self, duration: float = np.inf) -> RunReport:
        """Wait for sound readings, run, and stop.

        Args:
            duration: Time from the first command to the stop [s].

        Returns:
            What it came to; it does not raise for what happens while it runs.

        Raises:
            ParamsError: a duration below 0, or a priority that the process may not have.
        """
        if not duration >= 0.0:
            raise ParamsError(f"duration: expected a time >= 0 [s], got {duration!r}")
        self._ending = None
        readings = LatestReadings(self._stepper.inputs, self._joints.period, self._spec.max_age)
        tick = _Tick(readings, watch=self._watch)
        times = np.zeros((KEPT, 2))
        with (
            real_time_priority(self._spec.priority),
            stopping_signals(lambda: self.stop("signal")),
            paused_garbage_collection(),
        ):
            begin = self._clock.now()
            if self._wait(tick):
                begin = self._clock.now()
                self._run(tick, begin, duration, times)
            seconds = self._clock.now() - begin
            try:
                self._link.close()
            except Exception as error:
                self._told(tick, error)
        joints = self._joints
        used = times[: min(tick.counts.ticks, KEPT)]
        return RunReport(
            ended=self._ending or "no readings",
            seconds=seconds,
            counts=tick.counts,
            wake=used[:, 0],
            work=used[:, 1],
            last_error=tick.last_error,
            flags={name: int(n) for name, n in zip(joints.flag_names, np.atleast_1d(tick.flagged), strict=False) if n},
            period=joints.period,
            watch=None if self._watch is None else self._watch.to_json(),
        )

    def _wait(self, tick: _Tick) -> bool:
        """Whether readings were sound for `arm_time` within `patience`, before a stop."""
        start, period, first = self._clock.now(), self._joints.period, None
        due, passed = start, 0
        while due - start <= self._spec.patience:
            self._clock.wait_until(due)
            self._read(tick, 1 + passed)
            if self._asked_to_stop(tick):
                return False
            first = (due if first is None else first) if self._sound(tick) else None
            passed = int((self._clock.now() - due) / period)
            due += (1 + passed) * period
            if first is not None and due - first >= self._spec.arm_time - 0.5 * period:
                tick.counts.late = tick.counts.missing = 0  # of the time before the first command
                return True
        return False

    def _sound(self, tick: _Tick) -> bool:
        """Whether the readings are recent, finite, and within the joints' ranges."""
        readings = tick.readings
        if not readings.sound:
            return False
        where = None if readings.position is None else readings.values[readings.position]
        return where is None or bool(np.all((where >= self._range[0]) & (where <= self._range[1])))

    def _run(self, tick: _Tick, begin: float, duration: float, times: FloatArray) -> None:
        """Ticks until the stop has ended."""
        period, counts = self._joints.period, tick.counts
        state, after = self._guard.initial(), self._guard.initial()
        due, passed, left, slip = begin, 0, None, period
        most = round(self._spec.stop_time / period)
        while left is None or left > 0.0:
            self._clock.wait_until(due)
            start = self._clock.now()
            before = tick.readings.values
            self._read(tick, 1 + passed)
            stopping = left is not None
            if passed and not stopping:
                for made_up in tick.readings.between(before, min(passed, MADE_UP)):
                    self._command(tick, made_up)
            if self._ending is None and start - begin >= duration - 0.5 * period:
                self.stop("duration")
            if left is None and self._asked_to_stop(tick):
                left = self._spec.stop_time
            fault = left is not None or passed * period > self._spec.max_age
            command = self._command(tick, tick.readings.values)
            for _ in range(1 + min(passed, most) if stopping else 1):  # hold and damp last as long by the clock
                self._guard.step(state, command, self._where(tick), float(fault), after)
                state, after = after, state
            mode = max(float(state[3 * self._n]), tick.inner if tick.inner >= GuardMode.HOLD else 0.0)
            counts.held += int(mode >= GuardMode.HOLD)
            self._write(tick, state[: self._n].copy(), mode)
            done = self._clock.now()
            times[counts.ticks % KEPT] = start - due, done - start
            counts.ticks += 1
            passed = int((done - due) / period)
            left = None if left is None else left - (1 + passed) * period
            counts.missed += passed > 0
            counts.skipped += passed
            moved = min(SLIP * period, slip) if tick.readings.late else 0.0
            slip = min(slip - moved + DRIFT * period, period)
            due += (1 + passed) * period + moved

    def _asked_to_stop(self, tick: _Tick) -> bool:
        """Whether the run is to end, by whomever."""
        try:
            if self._link.stop_requested():
                self.stop("stop message")
        except Exception as error:
            self._told(tick, error)
        return self._ending is not None

    def _read(self, tick: _Tick, elapsed: int) -> None:
        """The newest readings, or those of the last tick, `elapsed` periods ago, or none."""
        found: Message | None = None
        try:
            found = self._link.read()
        except Exception as error:
            tick.counts.link_errors += 1
            self._told(tick, error)
        arrival = tick.readings.update(found, elapsed)
        if arrival != "new":
            setattr(tick.counts, arrival, getattr(tick.counts, arrival) + 1)

    def _command(self, tick: _Tick, readings: Message) -> FloatArray:
        """(n,) the controller's command within the joints' ranges; NaN where it failed."""
        try:
            found = self._stepper.tick(readings)
        except (Exception, SystemExit) as error:
            tick.counts.controller_errors += 1
            self._told(tick, error)
            return np.full(self._n, np.nan)
        tick.inner = float(found["mode"][0]) if "mode" in found else 0.0
        if "flags" in found:
            tick.flagged += found["flags"] > 0.0
            if self._not_finite is not None and found["flags"][self._not_finite] > 0.0 and not tick.last_error:
                tick.last_error = f"the controller's command is not finite; {self._stepper.first_not_finite()}"
        if tick.watch is not None:
            self._watched(tick, found, readings)
        return np.clip(found["command"], *self._range)

    def _watched(self, tick: _Tick, found: Message, readings: Message) -> None:
        """Look at the models in this tick."""
        try:
            if tick.watch is not None and tick.readings.position is not None:
                tick.watch.tick(found, readings[tick.readings.position])
        except (Exception, SystemExit) as error:
            tick.counts.watch_errors += 1
            tick.watch = None
            self._told(tick, error)

    def _where(self, tick: _Tick) -> FloatArray:
        """(n,) positions for the guard; of drives that are no servos only whether they are known counts."""
        readings = tick.readings
        if readings.position is not None:
            return readings.values[readings.position]
        return np.full(self._n, 0.0 if readings.sound else np.nan)

    def _write(self, tick: _Tick, command: FloatArray, mode: float) -> None:
        if self._spec.dry:
            return
        try:
            self._link.write({"command": command, "mode": np.array([mode])})
        except Exception as error:
            tick.counts.link_errors += 1
            self._told(tick, error)

    @staticmethod
    def _told(tick: _Tick, error: BaseException) -> None:
        tick.last_error = f"{type(error).__name__}: {' '.join(str(error).split())}"[:300]
