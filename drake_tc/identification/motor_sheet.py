"""Data sheets of voltage-driven motors as YAML, the prior of `identify_motor`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from drake_tc.actuation.voltage_motor import VoltageMotor
from drake_tc.config.records import read_record
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import ParamsError
from drake_tc.identification.motor_prior import PriorWidths

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
