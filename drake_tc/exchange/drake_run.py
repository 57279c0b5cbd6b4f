"""Drake with a joint's terms, as its parser reads the written file, in a discrete `MultibodyPlant` by itself.

Drake's parser takes damping and the limit of effort from a URDF or SDF file. It does not use the dry friction of a
joint, and both formats have the rotor inertia and the gain of a servo only in Drake's own tags. What a file without
these tags does not have is not in the run either; the gain is that of the user's controller.
"""

import logging
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, PdControllerGains
from pydrake.systems.analysis import Simulator

from drake_tc.actuation.recorded_run import Link
from drake_tc.errors import ParamsError
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.target_run import PointMass, RunInput, WrittenFile
from drake_tc.exchange.urdf import to_urdf
from drake_tc.simulator_files.terms import Terms
from drake_tc.simulator_files.xml_tree import DRAKE, xml_tree
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
    file = WrittenFile(to_urdf(_one(terms), drake=True), "joint", torque_for_one=terms.kp)
    return _simulate(file, pendulum, given, own_links=False)


def simulate_plain_in_drake(
    write: Callable[[list[Projection]], str], terms: Terms, pendulum: Link | None, given: RunInput
) -> FloatArray:
    """The same with a URDF (`to_urdf`) or SDFormat file (`to_sdf`) without Drake's tags.

    Args:
        write: Gives the text of the file.
        terms: Of its actuator. The gain kp is that of the user's controller; an armature is that of tags that the
            user's file already has.
        pendulum: On the joint; None: it has no inertia but the armature.
        given: What moves it.
    """
    servo = (terms.kp, 0.0) if terms.drive == "position_servo" else None
    file = WrittenFile(write(_one(terms)), "joint", servo=servo, torque_for_one=terms.kp)
    return _simulate(file, pendulum, given, own_links=False, armature=terms.armature)


def simulate_file_in_drake(file: WrittenFile, pendulum: Link | None, given: RunInput) -> FloatArray:
    """The same with a URDF or SDFormat file as it is written; its other joints stand still.

    Args:
        file: With its own links, which are the load where the rig has a pendulum.
        pendulum: Of the rig; None: the load is recorded, and the links of the file weigh next to nothing.
        given: What moves it.

    Raises:
        ParamsError: Drake refuses the file.
    """
    return _simulate(file, pendulum, given, own_links=True)


def _simulate(
    file: WrittenFile, pendulum: Link | None, given: RunInput, *, own_links: bool, armature: float | None = None
) -> FloatArray:
    """The run of a file, whose links are its own or that of the run, with another rotor inertia if one is given."""
    plant = loaded(file.text, given.step, lambda text: text if pendulum and own_links else _with_link(text, pendulum))
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    inner = {int(joint.child_body().index()) for joint in joints}
    for body in (plant.get_body(BodyIndex(i)) for i in range(1, plant.num_bodies())):
        if int(body.index()) not in inner:
            plant.WeldFrames(plant.world_frame(), body.body_frame())
    joint = plant.GetJointByName(file.joint)
    joint.set_position_limits(np.full(1, -np.inf), np.full(1, np.inf))
    actuators = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
    own = next((each for each in actuators if each.joint().index() == joint.index()), None)
    if own is None:
        own = plant.AddJointActuator(file.joint, joint)
    if armature is not None:
        own.set_default_rotor_inertia(armature)
    if file.servo is not None and not own.has_controller():
        own.set_controller_gains(PdControllerGains(p=file.servo[0], d=file.servo[1]))
    if pendulum is None:
        plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    with refusing():
        plant.Finalize()
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    position, velocity = given.start
    start: Any = plant.GetPositionsAndVelocities(context)
    start[joint.position_start()], start[plant.num_positions() + joint.velocity_start()] = position, velocity
    plant.SetPositionsAndVelocities(context, start)
    for other in joints:
        if other.num_velocities() and other.index() != joint.index():
            other.Lock(context)
    instance = joint.model_instance()
    found = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices(instance)]
    place = [each.index() for each in found].index(own.index())
    load, at = plant.get_applied_generalized_force_input_port(), joint.velocity_start()
    forces: Any = np.zeros(plant.num_velocities())
    positions = np.full(given.command.size, np.nan)
    for i, u in enumerate(given.command):
        positions[i] = plant.GetPositions(context)[joint.position_start()]
        if own.has_controller():
            desired: Any = np.zeros(2 * len(found))
            desired[place] = u
            plant.get_desired_state_input_port(instance).FixValue(context, desired)
        else:
            pushed: Any = np.zeros(len(found))
            pushed[place] = file.torque_for_one * u
            plant.get_actuation_input_port(instance).FixValue(context, pushed)
        forces[at] = -given.load[i]
        load.FixValue(context, forces)
        simulator.AdvanceTo((i + 1) * given.period)
        if not abs(plant.GetPositions(context)[joint.position_start()]) < FARTHEST:
            break
    return positions


def loaded(text: str, step: float = 0.0, change: Callable[[str], str] = str) -> Any:
    """A plant that is not finalized, of a URDF or SDFormat text without its shapes, changed before it is parsed.

    Raises:
        ParamsError: Drake refuses the file.
    """
    plant: Any = MultibodyPlant(step)
    bare, kind = _without_shapes(text)
    with refusing(), _no_warning_of_friction():
        Parser(plant).AddModelsFromString(change(bare), kind)
    return plant


@contextmanager
def refusing() -> Iterator[None]:
    """Drake's errors about a file as one of ours.

    Raises:
        ParamsError: Drake refuses it.
    """
    try:
        yield
    except (RuntimeError, ValueError) as error:
        raise ParamsError(f"Drake refuses the file: {' '.join(str(error).split())}") from None


def _without_shapes(text: str) -> tuple[str, str]:
    """A URDF or SDFormat file without visual and collision shapes, for Drake's parser, and which of them it is."""
    tree = xml_tree(text)
    for link in tree.iter("link"):
        for shape in [each for each in link if each.tag in ("visual", "collision")]:
            link.remove(shape)
    for name in [each for each in tree.attrib if each.startswith("xmlns:")]:
        del tree.attrib[name]
    ET.register_namespace("drake", DRAKE[1:-1])
    return ET.tostring(tree, encoding="unicode"), "urdf" if tree.tag == "robot" else "sdf"


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
