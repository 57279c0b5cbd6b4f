"""How long sensors and filters take in a control loop; printed as rows (run with -s), each beside pydrake's floor.

The floor is a system that only copies, with the same ports, in the same run: what any system in Python costs.
"""

import time

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.systems.framework import LeafSystem

from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.models import __path__ as models
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot
from drake_tc.sensing.force_torque import ForceTorque
from drake_tc.sensing.joint_torque import JointTorque
from drake_tc.sensing.sensor import Sensor, SensorFault, SensorSpec

from .machine import slowness

pytestmark = pytest.mark.benchmark
TICK = 1e-3
ROUNDS = 2000


class Floor(LeafSystem):
    """A system that copies its input to its output and its state to its state."""

    def __init__(self, size: int):
        super().__init__()
        port = self.DeclareVectorInputPort("truth", size)
        state = self.DeclareDiscreteState(size)
        tickets = {port.ticket(), self.discrete_state_ticket(state)}

        def copy(context, output):
            output.set_value(port.Eval(context))

        def keep(context, values):
            values.set_value(state, context.get_discrete_state(state).value())

        self.DeclareVectorOutputPort("reading", size, copy, prerequisites_of_calc=tickets)
        self.DeclarePeriodicDiscreteUpdateEvent(TICK, 0.0, keep)


def times(system, output: str, size: int) -> np.ndarray:
    """(2,) median [us] of one evaluation of the output and of one update (0: none a tick), the input changed before."""
    context = system.CreateDefaultContext()
    source, port = system.get_input_port(0), system.GetOutputPort(output)
    seconds = np.zeros((ROUNDS, 2))
    for k in range(ROUNDS):
        source.FixValue(context, np.sin(0.01 * k + np.arange(size)))
        start = time.perf_counter()
        port.Eval(context)
        seen = time.perf_counter()
        seconds[k, 0] = seen - start
        if system.num_discrete_state_groups():
            values = system.EvalUniquePeriodicDiscreteUpdate(context)
            seconds[k, 1] = time.perf_counter() - seen
            context.SetDiscreteState(values)
    return 1e6 * np.median(seconds, axis=0)


def report(name: str, own: np.ndarray, floor: np.ndarray) -> None:
    print(f"\n{name}: output {own[0]:.1f} us, update {own[1]:.1f} us; floor {floor[0]:.1f} and {floor[1]:.1f} us")


SPECS = {
    "encoder": (SensorSpec(noise=1e-5, resolution=1e-5), ()),
    "all of it": (SensorSpec(noise=1e-5, resolution=1e-5, scale=1.1, bias=0.1, dropout=0.01), ()),
    "late": (SensorSpec(noise=1e-5, latency=4e-3), ()),
    "failing": (SensorSpec(noise=1e-5), (SensorFault("frozen", 1.0, 0.1), SensorFault("nan", 2.0, 0.1))),
}


@pytest.mark.parametrize("size", [6, 18])
@pytest.mark.parametrize("name", SPECS)
def test_a_sensor_is_no_slower_than_its_bound(name, size):
    """3 % of a tick beyond the floor; the goals are printed beside."""
    spec, faults = SPECS[name]
    floor = times(Floor(size), "reading", size)
    own = times(Sensor(size, spec, TICK, faults), "reading", size)
    report(f"Sensor {name!r}, {size} channels (4 and 8 us wanted)", own, floor)
    assert np.all(own - floor < 0.03e6 * TICK * slowness())


@pytest.mark.parametrize("size", [6, 18])
def test_the_filter_is_no_slower_than_its_bound(size):
    floor = times(Floor(size), "reading", size)
    own = times(SavitzkyGolayFilter(size, 80, 2, TICK), "estimate", size)
    report(f"SavitzkyGolayFilter, {size} signals, window 80, all derivatives (5 and 10 us wanted)", own, floor)
    assert np.all(own - floor < 0.03e6 * TICK * slowness())


@pytest.mark.parametrize("robot", ["hrp2_like_leg", "hrp2_like"])
@pytest.mark.parametrize("kind", ["force_torque", "joint_torque"])
def test_reaction_sensors(robot, kind):
    described = load_robot(f"{models[0]}/hrp2_like/{robot}.yaml")
    plant = make_plant(described, TICK)
    if kind == "force_torque":
        system = ForceTorque(plant, described, SensorSpec(noise=0.1), TICK)
    else:
        system = JointTorque(plant, described, SensorSpec(), TICK)
    context = system.CreateDefaultContext()
    forces = [SpatialForce(np.ones(3), np.ones(3)) for _ in range(plant.num_joints())]
    source, port, seconds = system.get_input_port(0), system.get_output_port(), []
    value = Value[list[SpatialForce]](forces)
    for _ in range(ROUNDS // 4):
        source.FixValue(context, value)
        start = time.perf_counter()
        port.Eval(context)
        seconds.append(time.perf_counter() - start)
    median = 1e6 * np.median(seconds)
    print(f"\n{type(system).__name__} of {robot}, {plant.num_joints()} joints in the plant: output {median:.1f} us")
    assert median < 0.2e6 * TICK * slowness()
