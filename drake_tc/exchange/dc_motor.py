"""Torque constant and resistance of a drive on a voltage, apart.

    kp V - damping v = kt/R (V - kt v) - (damping - kt^2/R) v,   R = kt/kp

Logs of voltage and motion know kp = kt/R alone, and the back-EMF kt^2/R v as a part of the viscous friction.
"""

from dataclasses import dataclass, replace

from drake_tc.errors import ParamsError
from drake_tc.exchange.projection import Loss, Projection, Vocabulary
from drake_tc.simulator_files.terms import Terms


@dataclass(frozen=True)
class DcMotor:
    """A motor on a voltage.

    Attributes:
        torque_constant: kt [N m/A], at the joint.
        resistance: R [Ohm].
        damping: Viscous friction without the back-EMF [N m s/rad].
    """

    torque_constant: float
    resistance: float
    damping: float


def dc_motor(terms: Terms) -> DcMotor | None:
    """The motor of a drive; None where it is not on a voltage, or its torque constant is not known.

    Args:
        terms: Of the drive.
    """
    kt = terms.torque_constant
    if terms.drive != "voltage" or kt is None:
        return None
    return DcMotor(kt, kt / terms.kp, terms.damping - kt * terms.kp)


def with_torque_constant(projection: Projection, torque_constant: float, target: Vocabulary) -> Projection:
    """The projection with the torque constant of a data sheet; a drive that is not on a voltage has no use for it.

    Args:
        projection: Of one joint.
        torque_constant: kt [N m/A].
        target: What it is projected to. Where the target or the drive has no use for the constant, this is one of the
            losses.

    Raises:
        ParamsError: not positive, or a back-EMF that exceeds the viscous friction.
    """
    if not 0.0 < torque_constant < float("inf"):
        raise ParamsError(f"export: --torque-constant: expected a positive number [N m/A], got {torque_constant:g}")
    if projection.terms.drive != "voltage":
        why = "the drive's input is not a voltage, so --torque-constant is not used"
        return replace(projection, losses=(*projection.losses, Loss("torque_constant", why)))
    terms = replace(projection.terms, torque_constant=torque_constant)
    motor = dc_motor(terms)
    if motor is not None and motor.damping < 0.0:
        raise ParamsError(
            f"export: a torque constant of {torque_constant:g} N m/A makes a back-EMF of"
            f" {terms.damping - motor.damping:.4g} N m s/rad, more than all viscous friction that was found"
            f" ({terms.damping:.4g}); give a smaller one"
        )
    if why := target.no_motor(terms):
        return replace(projection, losses=(*projection.losses, Loss("torque_constant", why)))
    return replace(projection, terms=terms)
