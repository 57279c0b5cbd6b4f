"""BAM: the parameters of a servo on a voltage.

Its friction is BAM's model m1, dry and viscous, or m2, with a Stribeck peak too. Friction that grows with the load is
m5, whose terms of the motor's torque and of rest are 0.

BAM loads a file whose entry `actuator` names one of its classes of servos; it comes from the file to merge into.

BAM's motor has a torque constant kt and a resistance R apart (`dc_motor`).

BAM's own equations with a joint's terms: friction takes at most what stops the joint within a step.

    F = frictionloss + load_friction |tau_out| + height exp(-|v / velocity|^exponent) + damping |v|
    tau = kp V - tau_out,   tau_out = tau_load + m g l sin(q - zero)
    tau_stop = I/h v + tau,   vdot = (tau - sign(tau_stop) min(|tau_stop|, F)) / I
    v[n+1] = v[n] + h vdot,   q[n+1] = q[n] + h v[n+1] + h^2/2 vdot

Source: Duclusaud, Passault, Padois and Ly, "Extended Friction Models for the Physics Simulation of Servo Actuators"
(2025), and its program. Here the back-EMF is a part of the damping, which differs in the step in which the joint stops.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from drake_tc.actuation.recorded_run import Link
from drake_tc.config.quoted import quoted
from drake_tc.errors import ParamsError
from drake_tc.exchange.mjcf import DcMotor, dc_motor
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.target_run import RunInput
from drake_tc.simulator_files.read import NO_LOAD_FRICTION
from drake_tc.simulator_files.terms import Terms
from drake_tc.types import FloatArray


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
    """BAM's name of the friction model (m1, m2 or m5), and its parameters by BAM's names."""
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


FASTEST = 1e4
"""A velocity beyond this is unstable [rad/s]."""


def simulate_as_bam(terms: Terms, pendulum: Link | None, given: RunInput) -> FloatArray:
    """(T,) position of one joint by BAM's equations [rad]; NaN from where the simulation is unstable.

    Args:
        terms: Of its actuator, BAM's m1, m2 or m5.
        pendulum: On the joint; None leaves the rotor alone.
        given: What moves it; `command` is a voltage [V].
    """
    h = given.step
    inertia = terms.armature + (pendulum.inertia if pendulum else 0.0)
    moment, zero = (pendulum.gravity_moment, pendulum.zero) if pendulum else (0.0, 0.0)
    time = np.arange(given.command.size) * given.period
    command = np.interp(time - terms.delay, time, given.command) if terms.delay else given.command
    q, v = given.start
    position = np.full(time.size, np.nan)
    for i in range(time.size):
        position[i] = q
        for _ in range(given.substeps):
            load = given.load[i] + moment * np.sin(q - zero)
            torque = terms.kp * command[i] - load
            stop = inertia / h * v + torque
            acceleration = (torque - np.sign(stop) * min(abs(stop), friction(terms, v, load))) / inertia
            v += h * acceleration
            q += h * v + 0.5 * h**2 * acceleration
        if not abs(v) < FASTEST:
            break
    return position


def friction(terms: Terms, velocity: float, load: float) -> float:
    """Most torque by which friction and damping brake [N m].

    Args:
        terms: Of the actuator.
        velocity: [rad/s].
        load: tau_out [N m].
    """
    force, speed = terms.frictionloss + terms.load_friction * abs(load), abs(velocity)
    if terms.stribeck is not None:
        peak = terms.stribeck
        force += peak.height * np.exp(-((speed / peak.velocity) ** peak.exponent))
    return float(force + terms.damping * speed)
