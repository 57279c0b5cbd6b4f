"""What happens when a sensor fails: the cases as data, run in any scenario, and what comes of each.

Eighteen cases: encoder, imu and force_torque, each frozen, dropped for 20 ms, dropped for good, biased, with spikes,
and NaN in one channel.

Smallest biases that are flagged within 50 ms of their start, with the leg's realistic sensors and the default monitor
(tests/loops/torque/test_fault_cases.py):

    encoder      3.1 mrad in mid swing and at rest (largest acceleration times the tick squared, and 1 mrad)
    imu          0.52 m/s^2, 0.051 rad/s
    force_torque in the air 21 N, 4.2 N m; in contact 102 N, 20.3 N m, as a jump: a load that comes slower than that
                 cannot be told from a bias. A slow scenario may take `monitor: {force_jump: 20.0, moment_jump: 4.0}`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.loops.torque.running import TorqueRecording, build_loop, run_loop
from drake_tc.loops.torque.scenario import SENSORS, Scenario
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.sensing.spec import SensorFault
from drake_tc.types import BoolArray, FloatArray

KINDS = ("frozen", "dropped_20ms", "dropped", "biased", "spikes", "nan")
"""What may go wrong with each sensor and is always flagged."""
LATE = "late"
"""A sensor whose readings are older for a while, which is flagged where they jump by that."""
BIASES: Mapping[str, tuple[float, int]] = {"encoder": (0.05, 3), "imu": (3.0, 3), "force_torque": (150.0, 2)}
"""Size and channel of the biased cases and of spikes: 0.05 rad on the fourth joint, 3 m/s^2 on accel x, 150 N on fz."""
OFTEN = 0.2
"""Probability of a spike per sample [-]."""
FLAGGED_WITHIN = 0.05
"""A fault must be flagged this soon after its start [s]."""


@dataclass(frozen=True)
class FaultCase:
    """One sensor that fails in one way.

    Attributes:
        sensor: "encoder", "imu" or "force_torque".
        kind: One of `KINDS`, or `LATE`.
        bias: Size of a bias or of spikes [rad | rad/s | m/s^2 | N | N m]; None: that of `BIASES`. Of a late one its age
            [s].
        channel: Of a biased or NaN case or of spikes; None: that of `BIASES`.
    """

    sensor: str
    kind: str
    bias: float | None = None
    channel: int | None = None

    def __post_init__(self) -> None:
        if self.sensor not in SENSORS:
            raise ParamsError(f"fault case: no sensor {self.sensor!r}; possible: {', '.join(SENSORS)}")
        if self.kind not in (*KINDS, LATE):
            raise ParamsError(f"fault case: no kind {self.kind!r}; possible: {', '.join((*KINDS, LATE))}")

    @property
    def name(self) -> str:
        """Like encoder-dropped_20ms."""
        return f"{self.sensor}-{self.kind}"

    def fault(self, start: float) -> SensorFault:
        """What the sensor does from `start` [s] on."""
        size, channel = BIASES[self.sensor]
        size = size if self.bias is None else self.bias
        channel = channel if self.channel is None else self.channel
        if self.kind == "biased":
            return SensorFault("biased", start, channels=(channel,), value=size)
        if self.kind == "spikes":
            return SensorFault("spikes", start, channels=(channel,), value=size, chance=OFTEN)
        if self.kind == "dropped_20ms":
            return SensorFault("dropped", start, duration=0.02)
        if self.kind == LATE:
            return SensorFault("late", start, value=0.0 if self.bias is None else self.bias)
        if self.kind == "nan":
            return SensorFault("nan", start, channels=(channel,))
        return SensorFault("frozen" if self.kind == "frozen" else "dropped", start)

    def groups(self, robot: Robot) -> tuple[str, ...]:
        """Flags whose names begin so belong to the sensor."""
        if self.sensor != "force_torque":
            return (f"{self.sensor}/",)
        return tuple(f"{mount.name}/" for mount in robot.force_torque)


CASES = tuple(FaultCase(sensor, kind) for sensor in SENSORS for kind in KINDS)


@dataclass(frozen=True, eq=False)
class FaultOutcome:
    """What came of a case.

    Attributes:
        case, start: Which fault, from when on [s].
        recording: All signals.
        own: (T,) whether a flag of the failed sensor was up.
    """

    case: FaultCase
    start: float
    recording: TorqueRecording
    own: BoolArray

    @property
    def after(self) -> BoolArray:
        """(T,) truth: from the fault on."""
        return np.asarray(self.recording.time >= self.start - 1e-9)

    @property
    def flagged_after(self) -> float:
        """From the fault's start to the first flag of its sensor [s]; infinite without one."""
        up = np.flatnonzero(self.own & self.after)
        return float(self.recording.time[up[0]] - self.start) if up.size else float("inf")

    @property
    def flagged_before(self) -> bool:
        """Whether any flag was up before the fault: a false alarm."""
        return bool(np.any(self.recording["flags"][~self.after] > 0.0))

    @property
    def error(self) -> FloatArray:
        """(n,) largest |q_d - q| from the fault on [rad]."""
        return np.asarray(np.abs(self.recording.tracking_error[self.after]).max(axis=0))

    @property
    def travel(self) -> FloatArray:
        """(n,) how far the reference itself goes from the fault on [rad]: the error of a joint that stops."""
        path = self.recording["reference"][self.after, : self.recording.size]
        return np.asarray(np.abs(path - path[0]).max(axis=0))

    @property
    def excess(self) -> float:
        """Largest part of an error that is not the reference going on without the joint [rad]."""
        return float((self.error - self.travel).max())

    @property
    def torque_share(self) -> float:
        """Largest torque of an actuator over its limit [-]."""
        limit = joint_limits(self.recording.robot).effort
        return float((np.abs(self.recording["joint_torque"][self.after]) / limit).max())

    @property
    def finite(self) -> bool:
        """Whether command, state, torques and flags are finite throughout."""
        names = ("command", "joint_state", "actuation", "joint_torque", "estimated_torque", "flags", "mode")
        return all(bool(np.isfinite(self.recording[name]).all()) for name in names)


def run_case(scenario: Scenario, case: FaultCase, start: float) -> FaultOutcome:
    """Run a scenario in which one sensor fails.

    Args:
        scenario: A torque-controlled one; its own faults are replaced.
        case: What fails.
        start: When [s].

    Raises:
        ParamsError: a scenario that cannot be built.
        SimulationError: the loop ran away.
    """
    loop = build_loop(scenario.changed(faults={case.sensor: (case.fault(start),)}, log_truth=True))
    recording = run_loop(loop)
    groups = case.groups(loop.robot)
    mine = [i for i, name in enumerate(recording.flag_names) if name.startswith(groups)]
    return FaultOutcome(case, start, recording, np.any(recording["flags"][:, mine] > 0.0, axis=1))
