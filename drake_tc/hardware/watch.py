"""`ModelWatch` compares a running controller's models with its readings, or learns their errors from a sound run."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.hardware.stepper import ControllerStepper
from drake_tc.loops.built_loop import Controller
from drake_tc.types import FloatArray
from drake_tc.watch.health import ModelHealth, health_of
from drake_tc.watch.in_loop import SIGNALS, LoopMonitor
from drake_tc.watch.monitor import CAUSES

MOST_EVENTS = 1000
"""Events that are kept; of a longer list the first ones."""
LONGEST_S = 600.0
"""Longest part of a run that is kept to learn from [s]: about 20 MB a minute of six joints."""


@dataclass(frozen=True)
class WatchEvent:
    """A cause that the monitor named.

    Attributes:
        joint, cause: Which.
        begin, end: When since the first command [s]; `end` is None while it is named.
        change: By how much, as `ModelMonitor` has it, at its largest.
    """

    joint: str
    cause: str
    begin: float
    end: float | None
    change: float

    def __str__(self) -> str:
        size = (
            f"{100.0 * self.change:+.0f} %" if self.cause in ("friction", "torque_constant") else f"{self.change:+.3g}"
        )
        until = "" if self.end is None else f" to {self.end:.2f} s"
        return f"{self.joint}: {self.cause} {size} from {self.begin:.2f} s{until}"


class ModelWatch:
    """Whether the models of a controller still hold while it runs.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> controller = torque_controller(robot, load_models(robot.actuators))
        >>> health = ModelHealth(robot.joints, np.full(6, 1.0), np.full(6, 0.03), np.zeros((6, 7)))
        >>> ModelWatch(controller, health).events
        ()
    """

    def __init__(self, controller: Controller, health: ModelHealth | None = None) -> None:
        """Make the monitor.

        Args:
            controller: From `torque_controller`.
            health: What its models err by while nothing has changed; None: `learned` tells it after the run.

        Raises:
            ParamsError: a controller without torque control, or a joint that `health` lacks.
        """
        self._watched, self._joints = LoopMonitor.watched(controller), controller.controlled.joints
        self._period, n = controller.controlled.period, len(self._joints)
        nothing = ModelHealth(self._joints, np.ones(n), np.full(n, self._period), np.zeros((n, len(CAUSES))))
        self._monitor = LoopMonitor(controller, health or nothing)
        outputs = ("cause", "change") if health is not None else ("seen",)
        self._stepper, self._learns = ControllerStepper(self._monitor, self._period, outputs), health is None
        self._seen: list[FloatArray] = []
        self._cause, self._open = np.zeros(n), [None] * n
        self._events: list[dict[str, Any]] = []
        self.pushed = np.zeros(n)
        """(n,) ticks in which a joint was pushed."""

    @property
    def signals(self) -> tuple[str, ...]:
        """Outputs of the controller that `tick` reads, beside the reading `position`."""
        return SIGNALS

    @property
    def events(self) -> tuple[WatchEvent, ...]:
        """What was named, in the order of time."""
        return tuple(WatchEvent(**event) for event in self._events)

    def tick(self, found: Mapping[str, FloatArray], position: FloatArray) -> None:
        """One tick of the controller.

        Args:
            found: Its outputs `SIGNALS`.
            position: (n,) as read [rad].
        """
        told = self._stepper.tick({**{name: found[name] for name in SIGNALS}, "position": position})
        if self._learns:
            if len(self._seen) * self._period < LONGEST_S:
                self._seen.append(told["seen"])
            return
        time, cause = self._stepper.ticks * self._period, told["cause"]
        self.pushed += cause < 0.0
        for changed in np.flatnonzero(np.maximum(cause, 0.0) != self._cause).tolist():
            self._change(changed, max(int(cause[changed]), 0), time)
        self._cause = np.maximum(cause, 0.0)
        for j, event in enumerate(self._open):
            if event is not None and abs(told["change"][j]) > abs(event["change"]):
                event["change"] = float(told["change"][j])

    def _change(self, joint: int, code: int, time: float) -> None:
        event = self._open[joint]
        if event is not None:
            event["end"] = time
        self._open[joint] = None
        if code and len(self._events) < MOST_EVENTS:
            made: Any = {
                "joint": self._joints[joint], "cause": CAUSES[code - 1], "begin": time, "end": None, "change": 0.0
            }  # fmt: skip
            self._open[joint] = made
            self._events.append(made)

    def learned(self) -> ModelHealth:
        """The health of the models by this run, in which nothing was to change.

        Raises:
            ParamsError: a watch that does not learn, or a joint that hardly moved.
        """
        if not self._learns:
            raise ParamsError("ModelWatch.learned: expected a watch without `health`, got one that was given it")
        n = len(self._joints)
        seen = np.array(self._seen).reshape(-1, 5, n)
        sound = np.isfinite(seen).all(axis=(1, 2))
        return health_of(list(self._watched.models), seen[sound], self._period)

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        pushed = {joint: int(ticks) for joint, ticks in zip(self._joints, self.pushed, strict=True) if ticks}
        events = [asdict(event) for event in self.events]
        return {"learns": self._learns, "events": events, "pushed_ticks": pushed}
