"""Data sheets of voltage-driven motors as YAML, the prior of `identify_motor`."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from drake_tc.actuation.voltage_motor import VoltageMotor
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import IdentificationError, ParamsError
from drake_tc.identification.motor_prior import PriorWidths

ALL = "all"
"""Stands for every joint that the file does not name."""
_OPTIONAL = ("voltage_limit",)


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
    widths: PriorWidths

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
    document = read_yaml(path, "data sheet")
    if not isinstance(document, dict) or not isinstance(document.get("motors"), dict) or not document["motors"]:
        raise ParamsError(f"{path}: motors: wanted a mapping of joint, or {ALL!r}, to a motor; got {document!r:.60}")
    if strange := sorted(map(str, set(document) - {"motors", "widths"})):
        raise ParamsError(f"{path}: unknown key {strange[0]!r}; possible: motors, widths")
    known = [item.name for item in fields(VoltageMotor)]
    motors = {}
    for joint, entry in document["motors"].items():
        where = f"{path}: motors.{joint}"
        values = _numbers(where, entry, known, _OPTIONAL)
        try:
            motors[str(joint)] = VoltageMotor(**values)
        except ParamsError as error:
            raise ParamsError(f"{where}{str(error).removeprefix('motor')}") from None
    names = [item.name for item in fields(PriorWidths)]
    try:
        widths = PriorWidths(**_numbers(f"{path}: widths", document.get("widths") or {}, names, names))
    except IdentificationError as error:
        raise ParamsError(f"{path}: {error}") from None
    return MotorSheet(path, motors, widths)


def _numbers(where: str, entry: Any, known: list[str], optional: tuple[str, ...] | list[str]) -> dict[str, float]:
    """`entry` as numbers under known names."""
    if not isinstance(entry, dict):
        raise ParamsError(f"{where}: wanted a mapping of {', '.join(known)}; got {entry!r}")
    if strange := sorted(map(str, set(entry) - set(known))):
        raise ParamsError(f"{where}: unknown key {strange[0]!r}; possible: {', '.join(known)}")
    if missing := [name for name in known if name not in entry and name not in optional]:
        raise ParamsError(f"{where}: missing key {missing[0]!r}; wanted: {', '.join(known)}")
    found = {}
    for name, value in entry.items():
        try:
            found[name] = float("nan") if isinstance(value, bool) else float(value)
        except (TypeError, ValueError):
            raise ParamsError(f"{where}.{name}: wanted a number; got {value!r}") from None
    return found
