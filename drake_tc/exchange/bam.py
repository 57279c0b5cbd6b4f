"""BAM: the parameters of a servo on a voltage.

Its friction is BAM's model m1, dry and viscous, or m2, with a Stribeck peak too. Friction that grows with the load is
m5, whose terms of the motor's torque and of rest are 0.

BAM loads a file whose entry `actuator` names one of its classes of servos; it comes from the file to merge into.

BAM's motor has a torque constant kt and a resistance R apart (`dc_motor`).
"""

import json
from collections.abc import Sequence
from pathlib import Path

from drake_tc.config.quoted import quoted
from drake_tc.errors import ParamsError
from drake_tc.exchange.dc_motor import DcMotor, dc_motor
from drake_tc.exchange.projection import Projection
from drake_tc.simulator_files.bam import NO_LOAD_FRICTION
from drake_tc.simulator_files.terms import Terms


def to_bam(projections: Sequence[Projection], into: Path | None = None) -> str:
    """The text of a BAM parameter file.

    Args:
        projections: Exactly one, with a torque constant (`with_torque_constant`): a file is of one servo.
        into: A BAM file whose other entries stay.

    Raises:
        ParamsError: more than one joint, another drive than a voltage, no torque constant, or an unreadable file.
    """
    if len(projections) != 1:
        names = ", ".join(projection.joint for projection in projections)
        raise ParamsError(f"export --to bam: expected one joint, choose it with --joint, got {names}")
    terms = projections[0].terms
    motor = voltage_motor(projections[0], "bam")
    model, friction = bam_friction(terms, motor)
    found: dict[str, object] = {
        "model": model,
        "kt": motor.torque_constant,
        "R": motor.resistance,
        "armature": terms.armature,
        **friction,
        "command_delay": terms.delay,
        "q_offset": 0.0,
    }
    return json.dumps(_existing(into) | found, indent=2) + "\n"


def voltage_motor(projection: Projection, target: str) -> DcMotor:
    """The motor of a drive on a voltage.

    Args:
        projection: Of one joint.
        target: Name on the command line, for the message.

    Raises:
        ParamsError: another drive than a voltage, or no torque constant.
    """
    terms = projection.terms
    if terms.drive != "voltage":
        raise ParamsError(
            f"export --to {target}: BAM's servo is driven by a voltage; {projection.joint} has drive {terms.drive}"
        )
    motor = dc_motor(terms)
    if motor is None:
        raise ParamsError(
            f"export --to {target}: logs tell kt/R alone; give the torque constant of the data sheet:"
            " --torque-constant KT"
        )
    return motor


def bam_friction(terms: Terms, motor: DcMotor) -> tuple[str, dict[str, float]]:
    """BAM's name of the friction model (m1, m2 or m5), and its parameters by BAM's names.

    Args:
        terms: Of the actuator.
        motor: Of its drive; the back-EMF is not friction.
    """
    found = {"friction_base": terms.frictionloss, "friction_viscous": motor.damping}
    if terms.stribeck is not None:
        peak = terms.stribeck
        found |= {"friction_stribeck": peak.height, "dtheta_stribeck": peak.velocity, "alpha": peak.exponent}
    if not terms.load_friction:
        return "m1" if terms.stribeck is None else "m2", found
    no_peak = {"friction_stribeck": 0.0, "dtheta_stribeck": 0.2, "alpha": 1.0}
    load = dict.fromkeys(NO_LOAD_FRICTION, 0.0) | {"load_friction_external": terms.load_friction}
    return "m5", no_peak | found | load


def _existing(into: Path | None) -> dict[str, object]:
    if into is None:
        return {}
    try:
        document = json.loads(into.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParamsError(f"{into}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise ParamsError(f"{into}: not JSON: {error}") from None
    if not isinstance(document, dict):
        raise ParamsError(f"{into}: expected a BAM parameter file, a mapping, got {quoted(document)}")
    return document
