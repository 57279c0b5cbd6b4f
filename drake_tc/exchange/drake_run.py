"""Drake with a joint's terms, as `to_urdf` writes them with Drake's tags, in a discrete `MultibodyPlant` by itself."""

import re
from typing import Any

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator

from drake_tc.actuation.recorded_run import Link
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.target_run import PointMass, RunInput
from drake_tc.exchange.urdf import to_urdf
from drake_tc.simulator_files.terms import Terms
from drake_tc.types import FloatArray

FARTHEST = 1e4
"""A position beyond this is unstable [rad]."""


def simulate_in_drake(terms: Terms, pendulum: Link | None, given: RunInput) -> FloatArray:
    """(T,) position of one joint in Drake [rad]; NaN from where the simulation is unstable.

    Args:
        terms: Of its actuator.
        pendulum: On the joint; None leaves the rotor alone.
        given: What moves it. A position servo is Drake's own, by `drake:controller_gains`; the command of another
            drive is applied as the torque kp u.
    """
    plant: Any = MultibodyPlant(given.step)
    text = re.sub(r"<inertial>.*?</inertial>", _inertial(pendulum), _urdf(terms), flags=re.S)
    (instance,) = Parser(plant).AddModelsFromString(text, "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    joint = plant.GetJointByName("joint")
    joint.set_position_limits(np.full(1, -np.inf), np.full(1, np.inf))
    plant.Finalize()
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    position, velocity = given.start
    plant.SetPositions(context, np.full(1, position))
    plant.SetVelocities(context, np.full(1, velocity))
    servo = terms.drive == "position_servo"
    command = plant.get_desired_state_input_port(instance) if servo else plant.get_actuation_input_port(instance)
    load = plant.get_applied_generalized_force_input_port()
    positions = np.full(given.command.size, np.nan)
    for i, u in enumerate(given.command):
        positions[i] = plant.GetPositions(context)[0]
        command.FixValue(context, [u, 0.0] if servo else [terms.kp * u])
        load.FixValue(context, [-given.load[i]])
        simulator.AdvanceTo((i + 1) * given.period)
        if not abs(plant.GetPositions(context)[0]) < FARTHEST:
            break
    return positions


def _urdf(terms: Terms) -> str:
    return to_urdf([Projection("joint", terms, (), None)], drake=True)


def _inertial(pendulum: Link | None) -> str:
    """URDF of the link, about the axis y."""
    link = PointMass(1e-3, 0.0, 1e-9, 0.0) if pendulum is None else PointMass.of(pendulum)
    centre = " ".join(f"{value:.12g}" for value in link.centre())
    own = " ".join(f'{name}="{link.inertia:.12g}"' for name in ("ixx", "iyy", "izz"))
    return (
        f'<inertial><origin xyz="{centre}"/><mass value="{link.mass:.12g}"/>'
        f'<inertia {own} ixy="0" ixz="0" iyz="0"/></inertial>'
    )
