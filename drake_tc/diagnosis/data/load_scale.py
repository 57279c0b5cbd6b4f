"""What fixes the scale of the torques of a joint whose load is unknown.

Without a load torque the balance  y*/K = J qddot + G(q) + friction  holds for every drive gain K: all torques scale
with 1/K. A declared drive gain fixes the scale, and so does
a drive that is commanded in N m. A declared rotor inertia fixes it for a load that has no inertia of
its own, which is a smooth function of the position: J qddot is then a known torque. An unknown pendulum's inertia adds
to J, so J fixes nothing. Where nothing fixes the scale, K is set to 1 effort/(N m) and torques are told as effort.
"""

from dataclasses import dataclass

from drake_tc.effects.context import EFFORT_UNIT
from drake_tc.logs.loads import unknown_form
from drake_tc.logs.rig import Rig


@dataclass(frozen=True)
class LoadScale:
    """How a joint's torques are scaled.

    Attributes:
        gain: Drive gain K [effort/(N m)] at which the fits are held; None: fitted.
        rotor_inertia: Declared J that takes part in the balance [kg m^2].
        fitted_inertia: Whether an inertia of the load is part of the fit.
        as_effort: Whether nothing fixes the scale, so that the torques are told as effort.
        notes: What the reader must know of it; () where the load is known or the gain is declared.
    """

    gain: float | None
    rotor_inertia: float
    fitted_inertia: bool = False
    as_effort: bool = False
    notes: tuple[str, ...] = ()


def load_scale(rig: Rig, joint: str) -> LoadScale:
    """What fixes the scale of the joint's torques."""
    form, declared = unknown_form(rig.load[joint]), rig.drive_gain.get(joint)
    inertia = rig.known(joint, "rotor_inertia")
    if form is None:
        return LoadScale(declared, inertia)
    if declared is not None:
        return LoadScale(declared, inertia, fitted_inertia=True)
    if rig.drive[joint] == "torque":
        note = "The load is unknown, so the drive is assumed to produce the commanded torque (drive_gain: 1)."
        return LoadScale(1.0, inertia, fitted_inertia=True, notes=(note,))
    if form == "smooth" and inertia > 0.0:
        note = (
            f"The load is unknown; the declared rotor inertia of {inertia:.4g} kg m^2 fixes the scale of the torques, "
            "and the load is taken to have no inertia of its own."
        )
        return LoadScale(None, inertia, notes=(note,))
    unit = EFFORT_UNIT[rig.drive[joint]]
    note = (
        f"Torques are reported as effort [{unit}]: the drive gain is set to 1 {unit} per N*m, because nothing in the "
        "rig fixes the scale of an unknown load; declare drive_gain to get N*m."
    )
    if inertia > 0.0:
        note += " The declared rotor inertia does not fix it: the unknown inertia of the load adds to it."
    return LoadScale(1.0, 0.0, fitted_inertia=True, as_effort=True, notes=(note,))
