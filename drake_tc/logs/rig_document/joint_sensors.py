"""What the rig file's key `sensors` says of a joint's own sensors: noise of its channels, and tolerances.

Plain numbers are SI. Tolerances are standard deviations; a sensor has none unless one is declared.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any

from drake_tc.config.keys import Keys, Ratio, key, magnitude_in
from drake_tc.logs.sensors import JointSensors
from drake_tc.logs.units import allowed_units

Torque = Annotated[float, *magnitude_in(allowed_units("torque"))]
Current = Annotated[float, *magnitude_in(allowed_units("current"))]
Voltage = Annotated[float, *magnitude_in(allowed_units("voltage"))]
Time = Annotated[float, *magnitude_in(allowed_units("time"))]
Position = Annotated[float, *magnitude_in(allowed_units("position"))]

_ATTRIBUTES: Mapping[tuple[str, ...], str] = {
    ("torque_noise",): "torque_noise",
    ("correlation_time",): "torque_correlation_time",
    ("encoder_step",): "encoder_step",
    ("position_noise",): "position_noise",
    ("torque", "bias"): "torque_bias",
    ("torque", "gain"): "torque_gain",
    ("encoder", "offset"): "encoder_offset",
    ("current", "bias"): "current_bias",
    ("voltage", "bias"): "voltage_bias",
    ("torque_command", "bias"): "torque_command_bias",
}
"""Keys, the outer one first, to the attribute of `JointSensors`."""


class TorqueSensorKeys(Keys):
    """Tolerances of a joint's torque sensor, as standard deviations."""

    bias: Torque | None = key(
        "Constant error of the torque.", unit="N·m", example="0.2 N*m", absent="a constant error is an effect"
    )
    gain: Ratio | None = key(
        "Relative error of the scale.", unit="–", example="1 %", absent="an error of the scale is an effect"
    )


class EncoderKeys(Keys):
    """Tolerance of a joint's encoder, as a standard deviation."""

    offset: Position | None = key(
        "Error of the zero.", unit="rad", example="0.2 deg", absent="an error of the zero is an effect"
    )


class CurrentKeys(Keys):
    """Tolerance of the recorded current, as a standard deviation."""

    bias: Current | None = key(
        "Error of the zero.", unit="A", example="20 mA", absent="an error of the zero is an effect"
    )


class VoltageKeys(Keys):
    """Tolerance of the recorded voltage, as a standard deviation."""

    bias: Voltage | None = key(
        "Error of the zero.", unit="V", example="50 mV", absent="an error of the zero is an effect"
    )


class TorqueCommandKeys(Keys):
    """Tolerance of the drive that makes the commanded torque, as a standard deviation."""

    bias: Torque | None = key(
        "Constant by which the torque differs from its command.",
        unit="N·m",
        example="0.1 N*m",
        absent="an error of the zero is an effect",
    )


class JointSensorKeys(Keys):
    """Noise of a joint's own channels, which replaces what is estimated from the log, and tolerances of its sensors."""

    torque_noise: Torque | None = key(
        "Standard deviation of one raw sample of the torque, before any filter.",
        unit="N·m",
        example="0.25 N*m",
        absent="estimated from the log",
    )
    correlation_time: Time | None = key(
        "Time over which the noise of the torque is correlated. White noise has 0.",
        unit="s",
        example="20 ms",
        absent="0; noise that is slower than white is estimated from the residual",
    )
    encoder_step: Position | None = key(
        "Step between two neighbouring positions of the encoder.",
        unit="rad",
        example="0.09 deg",
        absent="read from the log",
    )
    position_noise: Position | None = key(
        "Standard deviation of one raw position, in addition to the rounding to steps.",
        unit="rad",
        example="0.1 mrad",
        absent="estimated from the log",
    )
    torque: TorqueSensorKeys | None = key(
        "Tolerances of the torque sensor; see below.",
        example={"bias": "0.2 N*m", "gain": "1 %"},
        absent="its errors are effects",
    )
    encoder: EncoderKeys | None = key(
        "Tolerance of the encoder; see below.", example={"offset": "0.2 deg"}, absent="its errors are effects"
    )
    current: CurrentKeys | None = key(
        "Tolerance of the recorded current of `drive: current`; see below.",
        example={"bias": "20 mA"},
        absent="its errors are effects",
    )
    voltage: VoltageKeys | None = key(
        "Tolerance of the recorded voltage of `drive: voltage`; see below.",
        example={"bias": "50 mV"},
        absent="its errors are effects",
    )
    torque_command: TorqueCommandKeys | None = key(
        "Tolerance of the drive of `drive: torque`; see below.",
        example={"bias": "0.1 N*m"},
        absent="its errors are effects",
    )

    @property
    def drives(self) -> dict[str, str]:
        """Kind of drive, by the key of each effort whose tolerance is given."""
        kinds = {"current": "current", "voltage": "voltage", "torque_command": "torque"}
        return {name: kind for name, kind in kinds.items() if getattr(self, name) is not None}

    def joint_sensors(self, before: JointSensors) -> JointSensors:
        """`before` with what is said here in its place."""
        said: dict[str, float] = {}
        for names, attribute in _ATTRIBUTES.items():
            value: Any = self
            for name in names:
                value = getattr(value, name, None)
            said |= {} if value is None else {attribute: value}
        return replace(before, **said)


def joint_entry(sensors: JointSensors) -> dict[str, Any]:
    """The keys' values in SI; reading them gives the same back."""
    out: dict[str, Any] = {}
    for names, attribute in _ATTRIBUTES.items():
        value = getattr(sensors, attribute)
        if value is not None:
            owner = out if len(names) == 1 else out.setdefault(names[0], {})
            owner[names[-1]] = value
    return out
