"""The unit of a drive's torque, by a load torque that is known.

The torque y of a drive that is commanded in N m balances the load tau beside inertia and friction,

    y = k tau + a qddot + f_v qdot + f_c sign(qdot) + c,       k = K, the declared drive gain or 1

No gear makes a k of 1000 K or K/1000 of a torque on the link's side, but a torque in mN m whose unit was not stated or
was stated wrongly does. Gains of currents, voltages and servos may have any size.
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.diagnosis.problem.drive_gain import beside_the_load
from drake_tc.effects.context import LoadKind
from drake_tc.errors import IdentificationError
from drake_tc.logs.rig import Rig
from drake_tc.logs.units import scale_of

THOUSAND, WITHIN = 1000.0, 2.0
"""Ratio of the two units, and the factor within which it is one."""
CERTAIN = 0.8
"""Correlation of effort and load, beside all else, above which their ratio means something."""
UNITS = {"revolute": {1.0: "N*m", 1e-3: "mN*m"}, "prismatic": {1.0: "N", 1e-3: "mN"}}
"""By factor to SI, the units between which a log and its rig file may differ."""


def require_torque_unit(columns: Columns, rig: Rig, joint: str, load_kind: LoadKind) -> None:
    """Refuse the torque of a drive that is 1000 times as large, or as small, as its known load asks for.

    A unit that the rig file states as a number is believed.

    Args:
        columns: Training rows.
        rig: Says the drive, its gain and the units.
        joint: Which.
        load_kind: Where the load comes from.

    Raises:
        IdentificationError: One line that names both units and the entry of the rig file.
    """
    if rig.drive[joint] != "torque" or columns.samples.load_unknown or load_kind == "links":
        return
    ratio = _gain(columns) / rig.drive_gain.get(joint, 1.0)
    power = next((p for p in (THOUSAND, 1.0 / THOUSAND) if p / WITHIN < ratio < p * WITHIN), None)
    if power is None:
        return
    sides = [("torque_command", 1.0 / power)] + ([("torque", power)] if load_kind == "torque" else [])
    found = [each for name, factor in sides if (each := _other_unit(rig, joint, name, factor)) is not None]
    if found:
        raise IdentificationError(_refusal(joint, ratio, found, UNITS[rig.joint_type(joint)][1.0]))


def _refusal(joint: str, ratio: float, found: Sequence[tuple[str, str, str]], si: str) -> str:
    """One line; `found` as `_other_unit` gives them, `si` the unit in which a number as a unit is told."""
    what = " or ".join(f"{joint}/{name} is in {other} and not in {said}" for name, said, other in found)
    entries = " or ".join(f"units: {{{joint}/{name}: {other}}}" for name, _, other in found)
    return (
        f"joint {joint}: the torque of the drive is {ratio:.3g} times what balances the load: {what}; set {entries} in "
        f"the rig file (a number, the factor to {si}, is believed)"
    )


def _other_unit(rig: Rig, joint: str, name: str, factor: float) -> tuple[str, str, str] | None:
    """(column, stated unit, unit) of a column whose scale is to be multiplied by a factor; None where it is no unit."""
    full = f"{joint}/{name}"
    if isinstance(rig.units.get(full, rig.units.get(name)), float | int):
        return None
    scale = scale_of(full, rig.units).factor
    units = UNITS[rig.joint_type(joint)]
    other = next((unit for value, unit in units.items() if np.isclose(abs(scale) * factor, value)), None)
    said = next((unit for value, unit in units.items() if np.isclose(abs(scale), value)), None)
    return None if other is None or said is None else (name, said, f"-{other}" if scale < 0.0 else other)


def _gain(columns: Columns) -> float:
    """The factor k of the module's equation; NaN where the effort does not follow the load."""
    samples = columns.samples
    effort, load = samples.reduce(samples.signals.effort), samples.reduce(samples.signals.load_torque)
    friction = next(iter(beside_the_load(columns, "torque")))
    others = np.column_stack([friction, samples.reduce(samples.signals.acceleration)])
    both = np.column_stack([effort, load])
    left = both - others @ np.linalg.lstsq(others, both, rcond=None)[0]
    squares = np.sum(left**2, axis=0)
    product = float(left[:, 0] @ left[:, 1])
    if not product > CERTAIN * float(np.sqrt(squares.prod())):
        return float("nan")
    return product / float(squares[1])
