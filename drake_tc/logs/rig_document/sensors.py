"""The rig file's key `sensors`: the joints' own sensors (`joint_sensors`), and tolerances of F/T sensors and IMUs.

Plain numbers are SI. Tolerances are standard deviations. What is not said of an F/T sensor or an IMU is that of its
`part`, or of a typical one (`drake_tc.logs.loads`). A joint's own sensor has no tolerance unless one is declared.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from drake_tc.config.keys import Keys, Ratio, key, magnitude, magnitude_in, magnitude_schema, unknown_key
from drake_tc.config.quoted import did_you_mean, quoted
from drake_tc.logs.loads import FORCE_TORQUE_PARTS, IMU_PARTS, ForceTorqueTolerance, ImuTolerance, JointSensors
from drake_tc.logs.loads import Tolerance as SensorTolerance
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
_EFFECT = "none"


class TorqueSensorKeys(Keys):
    """Tolerances of a joint's torque sensor, as standard deviations."""

    bias: Torque | None = key(
        "Constant error of the torque sensor, with `load: torque`.", unit="N·m", example="0.2 N*m", absent=_EFFECT
    )
    gain: Ratio | None = key("Relative error of its scale.", unit="–", example="1 %", absent=_EFFECT)


class EncoderKeys(Keys):
    """Tolerance of a joint's encoder, as a standard deviation."""

    offset: Position | None = key(
        "Error of the encoder's zero, where the load is a pendulum or the drive a position servo. With "
        "`load: {robot: ...}` it only limits what is reported.",
        unit="rad",
        example="0.2 deg",
        absent=_EFFECT,
    )


class CurrentKeys(Keys):
    """Tolerance of the recorded current, as a standard deviation."""

    bias: Current | None = key(
        "Error of the recorded current's zero, with `drive: current`.", unit="A", example="20 mA", absent=_EFFECT
    )


class VoltageKeys(Keys):
    """Tolerance of the recorded voltage, as a standard deviation."""

    bias: Voltage | None = key(
        "Error of the recorded voltage's zero, with `drive: voltage`.", unit="V", example="50 mV", absent=_EFFECT
    )


class TorqueCommandKeys(Keys):
    """Tolerance of the drive that makes the commanded torque, as a standard deviation."""

    bias: Torque | None = key(
        "Constant by which the torque differs from its command, with `drive: torque`.",
        unit="N·m",
        example="0.1 N*m",
        absent=_EFFECT,
    )


class JointSensorKeys(Keys):
    """Noise of a joint's own channels, which replaces what is estimated from the log, and tolerances of its sensors."""

    torque_noise: Torque | None = key(
        "Standard deviation of a raw sample of the torque, before any filter.",
        unit="N·m",
        example="0.25 N*m",
        absent="estimated from the log",
    )
    correlation_time: Time | None = key(
        "Time over which the noise of the torque is correlated.",
        unit="s",
        example="20 ms",
        absent="0 (white); slower noise is estimated from the residual",
    )
    encoder_step: Position | None = key(
        "Step between two neighbouring positions of the encoder.",
        unit="rad",
        example="0.09 deg",
        absent="read from the log",
    )
    position_noise: Position | None = key(
        "Standard deviation of a raw position, beside the rounding to steps.",
        unit="rad",
        example="0.1 mrad",
        absent="estimated from the log",
    )
    torque: TorqueSensorKeys | None = key(
        "Tolerances of the torque sensor.",
        example={"bias": "0.2 N*m", "gain": "1 %"},
        absent=_EFFECT,
    )
    encoder: EncoderKeys | None = key("Tolerance of the encoder.", example={"offset": "0.2 deg"}, absent=_EFFECT)
    current: CurrentKeys | None = key(
        "Tolerance of the recorded current of `drive: current`.",
        example={"bias": "20 mA"},
        absent=_EFFECT,
    )
    voltage: VoltageKeys | None = key(
        "Tolerance of the recorded voltage of `drive: voltage`.",
        example={"bias": "50 mV"},
        absent=_EFFECT,
    )
    torque_command: TorqueCommandKeys | None = key(
        "Tolerance of the drive of `drive: torque`.",
        example={"bias": "0.1 N*m"},
        absent=_EFFECT,
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


def _joint_entry(sensors: JointSensors) -> dict[str, Any]:
    """The keys' values in SI; reading them gives the same back."""
    out: dict[str, Any] = {}
    for names, attribute in _ATTRIBUTES.items():
        value = getattr(sensors, attribute)
        if value is not None:
            owner = out if len(names) == 1 else out.setdefault(names[0], {})
            owner[names[-1]] = value
    return out


def _pair_of(first: tuple[str, str], second: tuple[str, str]) -> Any:
    """Annotations of a list of two magnitudes, each given as (name, channel)."""

    def read(value: object) -> tuple[float, float]:
        if not isinstance(value, list) or len(value) != 2:
            raise ValueError(f"expected a list of two values, {first[0]} and {second[0]}, got {quoted(value)}")
        units = [allowed_units(channel) for _, channel in (first, second)]
        return magnitude(units[0])(value[0]), magnitude(units[1])(value[1])

    schema = {"type": "array", "items": magnitude_schema(), "minItems": 2, "maxItems": 2}
    return (BeforeValidator(read), WithJsonSchema(schema))


def _part_of(parts: Mapping[str, SensorTolerance]) -> Any:
    def read(name: object) -> str | None:
        if name is None:
            return None
        known = str(name).strip().lower().replace("-", "_").replace(" ", "_")
        if known not in parts:
            raise ValueError(f"unknown part {quoted(name)}{did_you_mean(known, parts)}; known: {', '.join(parts)}")
        return known

    return (BeforeValidator(read), WithJsonSchema({"type": "string", "examples": list(parts)}))


_TYPICAL = "that of `part`"


def _span(value: tuple[float, float]) -> tuple[float, float]:
    if not value[0] < value[1]:
        raise ValueError(f"expected begin < end [s], got {quoted(list(value))}")
    return value


Stretch = Annotated[tuple[float, float], *_pair_of(("begin", "time"), ("end", "time")), AfterValidator(_span)]


class ForceTorqueKeys(Keys):
    """Tolerances of one F/T sensor of the robot, as standard deviations, alike on all axes."""

    part: Annotated[str | None, *_part_of(FORCE_TORQUE_PARTS)] = key(
        f"Kind of sensor, whose tolerances hold by default: {', '.join(FORCE_TORQUE_PARTS)}.",
        example="typical",
        absent="typical",
    )
    bias: Annotated[tuple[float, float] | None, *_pair_of(("force bias", "fx"), ("torque bias", "tx"))] = key(
        "Constant error of the forces and of the torques.", unit="N, N·m", example=["2 N", "0.05 N*m"], absent=_TYPICAL
    )
    gain: Ratio | None = key("Relative error of the scale.", unit="–", example="1 %", absent=_TYPICAL)
    alignment: Position | None = key("Rotation error about each axis.", unit="rad", example="0.5 deg", absent=_TYPICAL)
    tare: Stretch | None = key(
        "Stretch of every run, from its first row, in which nothing touches the robot beyond the sensor, which is "
        "zeroed there. `bias` is then the tolerance of the remaining error.",
        unit="s",
        example=[0.0, "2 s"],
        absent="not zeroed",
    )

    def tolerance(self) -> ForceTorqueTolerance:
        """The sensor's tolerance."""
        biases = {} if self.bias is None else {"force_bias": self.bias[0], "torque_bias": self.bias[1]}
        return replace(FORCE_TORQUE_PARTS[self.part or "typical"], **biases, **_shared(self.gain, self.alignment))


class ImuKeys(Keys):
    """Tolerances of one IMU of the robot, as standard deviations, alike on all axes."""

    part: Annotated[str | None, *_part_of(IMU_PARTS)] = key(
        f"Kind of sensor, whose tolerances hold by default: {', '.join(IMU_PARTS)}.",
        example="mpu_6050",
        absent="typical",
    )
    bias: Annotated[tuple[float, float] | None, *_pair_of(("accel bias", "accel_x"), ("gyro bias", "gyro_x"))] = key(
        "Constant error of the accelerations and of the angular rates.",
        unit="m/s², rad/s",
        example=["0.02 m/s^2", "0.002 rad/s"],
        absent=_TYPICAL,
    )
    gain: Ratio | None = key("Relative error of the accelerometer's scale.", unit="–", example="0.5 %", absent=_TYPICAL)
    alignment: Position | None = key(
        "Rotation error about each axis, of accelerometer and gyro together.",
        unit="rad",
        example="0.5 deg",
        absent=_TYPICAL,
    )

    def tolerance(self) -> ImuTolerance:
        """The sensor's tolerance."""
        biases = {} if self.bias is None else {"accel_bias": self.bias[0], "gyro_bias": self.bias[1]}
        return replace(IMU_PARTS[self.part or "typical"], **biases, **_shared(self.gain, self.alignment))


def _shared(gain: float | None, alignment: float | None) -> dict[str, float]:
    return {name: value for name, value in (("gain", gain), ("alignment", alignment)) if value is not None}


def _sensor_properties(schema: dict[str, Any]) -> None:
    """The JSON schema as the file has it: sensors by their prefix, joints by any other name."""
    properties = schema["properties"]
    by_name = {alias: properties.pop(alias)["additionalProperties"] for alias in ("@ft", "@imu", "@joint")}
    schema["patternProperties"] = {"^ft_": by_name["@ft"], "^imu_": by_name["@imu"]}
    schema["additionalProperties"] = by_name["@joint"]


class SensorsKeys(JointSensorKeys, json_schema_extra=_sensor_properties):
    """What is said of all joints, of single joints, and of the robot's sensors."""

    # `sorted_by_owner` puts what the file says of joints, F/T sensors and IMUs under these.
    of_joints: dict[str, JointSensorKeys] = Field(default_factory=dict, alias="@joint")
    force_torque: dict[str, ForceTorqueKeys] = Field(default_factory=dict, alias="@ft")
    imu: dict[str, ImuKeys] = Field(default_factory=dict, alias="@imu")

    def of_joint(self, joint: str, *, torque_sensor: bool = True) -> JointSensors:
        """What is declared of one joint's sensors: its own, otherwise that of all joints.

        Without a torque sensor the joint has none of its tolerances.
        """
        everywhere = self.joint_sensors(JointSensors())
        own = self.of_joints.get(joint)
        found = everywhere if own is None else own.joint_sensors(everywhere)
        return found if torque_sensor else replace(found, torque_bias=None, torque_gain=None)

    def tares(self) -> dict[str, tuple[float, float]]:
        """Stretch of every run in which a sensor is zeroed [s], by column name (`ft_foot`)."""
        return {name: sensor.tare for name, sensor in self.force_torque.items() if sensor.tare is not None}

    def tolerances(self) -> dict[str, SensorTolerance]:
        """By column name (`ft_foot`)."""
        force_torque = {name: sensor.tolerance() for name, sensor in self.force_torque.items()}
        return force_torque | {name: sensor.tolerance() for name, sensor in self.imu.items()}


def sorted_by_owner(value: object, joints: Sequence[str]) -> object:
    """The mapping `sensors` with its entries by name sorted into joints, F/T sensors and IMUs.

    Raises:
        ValueError: A key is neither one of `JointSensorKeys` nor a joint nor begins like a sensor's.
    """
    if not isinstance(value, Mapping):
        return value
    own = tuple(JointSensorKeys.model_fields)
    result: dict[str, Any] = {"@joint": {}, "@ft": {}, "@imu": {}}
    for name, entry in value.items():
        owner = "@joint" if name in joints else "@ft" if name.startswith("ft_") else "@imu"
        if owner == "@imu" and not name.startswith("imu_"):
            if name not in own:
                allowed = (*own, *joints, "ft_<sensor>", "imu_<sensor>")
                raise ValueError(unknown_key(name, allowed))
            result[name] = entry
        else:
            result[owner][name] = {} if entry is None else entry
    return result


def sensors_entry(
    joints: Mapping[str, JointSensors],
    tolerances: Mapping[str, SensorTolerance],
    tares: Mapping[str, tuple[float, float]],
) -> dict[str, Any]:
    """The key's value in SI; reading it gives the same back. Empty where nothing is declared."""
    said = {joint: _joint_entry(each) for joint, each in joints.items()}
    same = all(each == next(iter(said.values())) for each in said.values())
    out: dict[str, Any] = dict(next(iter(said.values()), {})) if same else {j: e for j, e in said.items() if e}
    for column, tolerance in tolerances.items():
        if isinstance(tolerance, ForceTorqueTolerance):
            biases = [tolerance.force_bias, tolerance.torque_bias]
        else:
            biases = [tolerance.accel_bias, tolerance.gyro_bias]
        out[column] = {"bias": biases, "gain": tolerance.gain, "alignment": tolerance.alignment}
        if column in tares:
            out[column]["tare"] = list(tares[column])
    return out
