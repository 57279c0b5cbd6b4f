"""Drake with a joint's terms, as its parser reads the written file, in a discrete `MultibodyPlant` by itself.

Drake's parser takes damping and the limit of effort from a URDF or SDF file. It does not use the dry friction of a
joint, and both formats have the rotor inertia and the gain of a servo only in Drake's own tags. What a file without
these tags does not have is not in the run either; the gain is that of the user's controller.
"""

import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PdControllerGains
from pydrake.systems.analysis import Simulator

from drake_tc.actuation.recorded_run import Link
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.sdf import to_sdf
from drake_tc.exchange.target_run import PointMass, RunInput
from drake_tc.exchange.urdf import to_urdf
from drake_tc.simulator_files.terms import Terms
from drake_tc.types import FloatArray

FARTHEST = 1e4
"""A position beyond this is unstable [rad]."""
UNUSED_FRICTION = "'friction' attribute of a joint/dynamics tag"
"""Part of the parser's warning; an export says of each joint that its friction is not used."""


def simulate_in_drake(terms: Terms, pendulum: Link | None, given: RunInput) -> FloatArray:
    """(T,) position of one joint in Drake [rad]; NaN from where the simulation is unstable.

    Args:
        terms: Of its actuator, written with Drake's tags.
        pendulum: On the joint; None leaves the rotor alone.
        given: What moves it. A position servo is Drake's own, by `drake:controller_gains`; the command of another
            drive is applied as the torque kp u.
    """
    plant = _parsed(to_urdf(_one(terms), drake=True), "urdf", pendulum, given.step)
    return _simulate(plant, terms, given)


def simulate_urdf_in_drake(terms: Terms, pendulum: Link | None, given: RunInput) -> FloatArray:
    """The same with a URDF without Drake's tags.

    Args:
        terms: Of its actuator. The gain kp is that of the user's controller; an armature is that of tags that the
            user's file already has.
        pendulum: On the joint; None: it has no inertia but the armature.
        given: What moves it.
    """
    plant = _parsed(to_urdf(_one(terms)), "urdf", pendulum, given.step)
    return _simulate(_with_what_no_tag_says(plant, terms), terms, given)


def simulate_sdf_in_drake(terms: Terms, pendulum: Link | None, given: RunInput) -> FloatArray:
    """The same with an SDFormat file without Drake's tags.

    Args:
        terms: See `simulate_urdf_in_drake`.
        pendulum: See `simulate_urdf_in_drake`.
        given: What moves it.
    """
    plant = _parsed(to_sdf(_one(terms)), "sdf", pendulum, given.step)
    return _simulate(_with_what_no_tag_says(plant, terms), terms, given)


def _parsed(text: str, kind: str, pendulum: Link | None, step: float) -> Any:
    """The plant of a written bench, with the link of the run."""
    plant: Any = MultibodyPlant(step)
    with _no_warning_of_friction():
        Parser(plant).AddModelsFromString(_with_link(text, pendulum), kind)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.GetJointByName("joint").set_position_limits(np.full(1, -np.inf), np.full(1, np.inf))
    return plant


def _with_what_no_tag_says(plant: Any, terms: Terms) -> Any:
    actuator = plant.GetJointActuatorByName("joint")
    actuator.set_default_rotor_inertia(terms.armature)
    if terms.drive == "position_servo":
        actuator.set_controller_gains(PdControllerGains(p=terms.kp, d=0.0))
    return plant


def _simulate(plant: Any, terms: Terms, given: RunInput) -> FloatArray:
    plant.Finalize()
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    position, velocity = given.start
    plant.SetPositions(context, np.full(1, position))
    plant.SetVelocities(context, np.full(1, velocity))
    instance = plant.GetJointByName("joint").model_instance()
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


def _one(terms: Terms) -> list[Projection]:
    return [Projection("joint", terms, (), None)]


def _with_link(text: str, pendulum: Link | None) -> str:
    """The bench in URDF or SDF with the link of the run, about the axis y."""
    link = PointMass(1e-3, 0.0, 1e-9, 0.0) if pendulum is None else PointMass.of(pendulum)
    centre = " ".join(f"{value:.12g}" for value in link.centre())
    mass, inertia = f"{link.mass:.12g}", f"{link.inertia:.12g}"
    if "<sdf" in text:
        own = "".join(f"<{name}>{inertia}</{name}>" for name in ("ixx", "iyy", "izz"))
        made = f"<pose>{centre} 0 0 0</pose><mass>{mass}</mass><inertia>{own}</inertia>"
    else:
        own = " ".join(f'{name}="{inertia}"' for name in ("ixx", "iyy", "izz"))
        made = f'<origin xyz="{centre}"/><mass value="{mass}"/><inertia {own} ixy="0" ixz="0" iyz="0"/>'
    return re.sub(r"<inertial>.*?</inertial>", f"<inertial>{made}</inertial>", text, flags=re.S)


@contextmanager
def _no_warning_of_friction() -> Iterator[None]:
    """Without Drake's warning that the friction of a joint is not used."""

    def unless_friction(record: logging.LogRecord) -> bool:
        return UNUSED_FRICTION not in record.getMessage()

    log = logging.getLogger("drake")
    log.addFilter(unless_friction)
    try:
        yield
    finally:
        log.removeFilter(unless_friction)
