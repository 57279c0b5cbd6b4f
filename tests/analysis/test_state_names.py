"""Names of the states of a loop: each is that of the number that it names."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import DiscreteTimeDelay

from drake_tc.analysis.state_coordinates import StateCoordinates
from drake_tc.errors import ParamsError
from drake_tc.loops.torque.running import build_loop
from drake_tc.registry import diagram_entry


@pytest.fixture(scope="module")
def leg():
    """The loop of the leg after its start, with late sensors."""
    from pydrake.systems.analysis import Simulator

    loop = build_loop(diagram_entry("hrp2_leg").scenario("hanging").changed(sensors="perfect"))
    simulator = Simulator(loop.diagram)
    loop.start(simulator.get_mutable_context())
    simulator.AdvanceTo(0.7)
    return loop, simulator.get_context(), StateCoordinates(loop.diagram, simulator.get_context())


def test_every_state_of_the_torque_loop_has_a_name_of_its_own(leg):
    names = leg[2].names
    assert len(set(names)) == len(names) == leg[2].size
    assert {name.split(":")[0] for name in names} >= {"plant", "filter", "actuators", "torque_control", "guard"}
    unnamed = [name for name in names if ":" not in name]
    assert unnamed == []


def test_positions_and_speeds_are_those_of_the_plants_joints(leg):
    loop, context, coordinates = leg
    x = dict(zip(coordinates.names, coordinates.read(context), strict=True))
    own = loop.plant.GetMyContextFromRoot(context)
    for joint in loop.robot.joints:
        place = loop.plant.GetJointByName(joint)
        assert x[f"plant:{joint}_q"] == place.get_angle(own)
        assert x[f"plant:{joint}_w"] == place.get_angular_rate(own)


def test_the_newest_sample_of_the_filter_is_named_so(leg):
    loop, context, coordinates = leg
    x = dict(zip(coordinates.names, coordinates.read(context), strict=True))
    filter_ = loop.diagram.GetSubsystemByName("filter")
    size = filter_.get_input_port().size()
    windows = {name for name in x if name.startswith("filter:input[0]@")}
    newest = [x[f"filter:input[{i}]@-0"] for i in range(size)]
    ring = filter_.coordinates(filter_.GetMyContextFromRoot(context)).reshape(len(windows), size)
    assert_allclose(ring[-1], newest, rtol=0)
    assert_allclose(ring[0], [x[f"filter:input[{i}]@-{len(windows) - 1}"] for i in range(size)], rtol=0)


def test_the_bristle_of_a_joint_holds_that_joint_alone(leg):
    """Friction torque of the named joint changes with its deflection, and no other's does."""
    loop, context, coordinates = leg
    joint = loop.robot.joints[3]
    place = coordinates.names.index(f"actuators:{joint}/deflection")
    actuators = loop.diagram.GetSubsystemByName("actuators")
    found = []
    for deflection in (-0.5, 0.5):
        own = context.Clone()
        x = coordinates.read(own)
        x[place] = deflection
        coordinates.write(own, x)
        port = actuators.GetOutputPort("friction_torque")
        found.append(np.array(port.Eval(actuators.GetMyContextFromRoot(own))))
    moved = np.flatnonzero(np.abs(found[1] - found[0]) > 1e-6)
    assert moved.tolist() == [actuators.joints.index(joint)]


class Misnamed(LeafSystem):
    def __init__(self):
        super().__init__()
        self.DeclareDiscreteState(2)

    def coordinate_names(self):
        return ("one",)


def names_of(system):
    builder = DiagramBuilder()
    builder.AddNamedSystem("own", system)
    diagram = builder.Build()
    return StateCoordinates(diagram, diagram.CreateDefaultContext()).names


def test_systems_without_names_are_numbered_and_wrong_names_refused():
    assert names_of(DiscreteTimeDelay(0.01, 2, 1)) == ("own[0]", "own[1]", "own[2]")
    with pytest.raises(ParamsError, match="system 'own': expected 2 coordinate_names, got 1"):
        names_of(Misnamed())
