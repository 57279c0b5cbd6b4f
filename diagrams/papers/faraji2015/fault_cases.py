"""The cases of C.faults: every sensor with every kind of fault, standing and in the 1 Hz turn, and some more."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drake_tc.sensing.spec import SensorFault

STARTS = {"stand": 0.6, "turn_1hz": 1.0, "one_foot": 2.0}
"""When sensors fail, by scenario [s]: the trunk is at its fastest then, and the foot leaves the floor."""
DRIFT = float(np.deg2rad(1.0))
"""Of the gyro about the vertical [rad/s]."""
KNEE, FZ, YAW, FORWARDS = 3, 2, 2, 3
"""Channels: a knee's encoder, the right ankle's load, the gyro's yaw rate, the accelerometer forwards."""
Kind = tuple[str, str, Mapping[str, object]]
"""Of a fault: what is said of it, its kind, and the other fields of a `SensorFault`."""
WHOLE_SENSOR: tuple[Kind, ...] = (
    ("frozen", "frozen", {}),
    ("dropped", "dropped", {}),
    ("20 ms late", "late", {"value": 0.02}),
)


def _of_one_channel(where: str, channel: int, off: float, spike: float, unit: str) -> tuple[Kind, ...]:
    """A bias, NaN and spikes of one channel."""
    return (
        (f"off by {off:g} {unit} in {where}", "biased", {"channels": (channel,), "value": off}),
        (f"NaN in {where}", "nan", {"channels": (channel,)}),
        (f"spikes of {spike:g} {unit} in {where}", "spikes", {"channels": (channel,), "value": spike}),
    )


ONE_CHANNEL: Mapping[str, tuple[Kind, ...]] = {
    "motor_encoder": _of_one_channel("a knee", KNEE, 0.05, 0.05, "rad"),
    "encoder": _of_one_channel("a knee", KNEE, 0.05, 0.05, "rad"),
    "gauge": _of_one_channel("a knee", KNEE, 5.0, 5.0, "N m"),
    "imu": _of_one_channel("the acceleration forwards", FORWARDS, 3.0, 3.0, "m/s^2"),
    "force_torque": _of_one_channel("the load of a foot", FZ, 10.0, 50.0, "N"),
}


@dataclass(frozen=True)
class FaultCase:
    """One fault in one scenario.

    Attributes:
        scenario: Of diagrams/coman.scenario.yaml.
        name: For people.
        faults: As the scenario takes them.
        groups: Flags whose names begin so belong to what fails.
        sinks: Whether the robot is to come down, as nothing is left to stand by.
    """

    scenario: str
    name: str
    faults: Mapping[str, tuple[SensorFault, ...]]
    groups: tuple[str, ...]
    sinks: bool = False

    @property
    def label(self) -> str:
        """Like stand: imu, frozen."""
        return f"{self.scenario}: {self.name}"


_FEET = ("right_ankle/", "left_ankle/", "force_torque/")
_OWN = {
    "motor_encoder": ("motor_encoder/",),
    "encoder": ("encoder/",),
    "gauge": ("gauge/",),
    "imu": ("imu/",),
    "force_torque": _FEET,
}


def _case(scenario: str, sensor: str, what: str, kind: str, **fields: object) -> FaultCase:
    fault = SensorFault(kind, STARTS[scenario], **fields)  # type: ignore[arg-type]
    return FaultCase(scenario, f"{sensor}, {what}", {sensor: (fault,)}, _OWN[sensor])


def _lost_contact() -> FaultCase:
    """The right foot is lifted; its F/T sensor hangs with load on it, and the estimator is not told."""
    hangs = SensorFault("frozen", 1.0, channels=tuple(range(6)))
    unheard = SensorFault("frozen", 1.9)
    return FaultCase(
        "one_foot", "contact lost without notice", {"force_torque": (hangs,), "contacts": (unheard,)}, ("right_sole/",)
    )


def _blind() -> FaultCase:
    """Both encoders of every joint are lost."""
    gone = (SensorFault("dropped", STARTS["stand"]),)
    faults = {"motor_encoder": gone, "encoder": gone}
    return FaultCase("stand", "both encoders, dropped", faults, ("joint/",), sinks=True)


def cases() -> tuple[FaultCase, ...]:
    """All cases, in the order of the table: every sensor with every kind of fault in both scenarios, and some more."""
    found = [
        _case(scenario, sensor, what, kind, **fields)
        for scenario in ("stand", "turn_1hz")
        for sensor, of_one in ONE_CHANNEL.items()
        for what, kind, fields in (*WHOLE_SENSOR, *of_one)
    ]
    stand, turn = "stand", "turn_1hz"
    found += [
        _case(stand, "motor_encoder", "dropped for 20 ms", "dropped", duration=0.02),
        _case(stand, "imu", "dropped for 20 ms", "dropped", duration=0.02),
        _case(stand, "imu", "yaw drift of 1 deg/s", "biased", channels=(YAW,), value=DRIFT),
        _case(turn, "imu", "yaw drift of 1 deg/s", "biased", channels=(YAW,), value=DRIFT),
        _case(stand, "force_torque", "dropped for 20 ms", "dropped", duration=0.02),
        _case(stand, "force_torque", "off by 150 N", "biased", channels=(FZ,), value=150.0),
        _blind(),
        _lost_contact(),
    ]
    return tuple(sorted(found, key=lambda case: (list(STARTS).index(case.scenario), case.name)))
