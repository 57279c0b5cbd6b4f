"""BAM's own equations with a joint's terms: friction takes at most what stops the joint within a step.

    F = frictionloss + load_friction |tau_out| + height exp(-|v / velocity|^exponent) + damping |v|
    tau = kp V - tau_out,   tau_out = tau_load + m g l sin(q - zero)
    tau_stop = I/h v + tau,   vdot = (tau - sign(tau_stop) min(|tau_stop|, F)) / I
    v[n+1] = v[n] + h vdot,   q[n+1] = q[n] + h v[n+1] + h^2/2 vdot

Source: Duclusaud, Passault, Padois and Ly, "Extended Friction Models for the Physics Simulation of Servo Actuators"
(2025), and its program. Here the back-EMF is a part of the damping, which differs in the step in which the joint stops.
"""

import numpy as np

from drake_tc.actuation.recorded_run import Link
from drake_tc.exchange.target_run import RunInput
from drake_tc.simulator_files.terms import Terms
from drake_tc.types import FloatArray

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
