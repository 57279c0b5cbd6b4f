"""How long sensors and filters take in a control loop; printed as rows (run with -s)."""

import time

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce

from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.models import __path__ as models
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot
from drake_tc.sensing.robot_sensors import ForceTorque, JointTorque
from drake_tc.sensing.sensor import Sensor, SensorFault, SensorSpec
from drake_tc.sensing.spec import Sampling

from .machine import require

pytestmark = pytest.mark.benchmark
TICK = 1e-3
SAMPLES = 500


def require_times(name: str, system, output: str, goals: tuple[float, float]) -> None:
    """Require goals [s] of one evaluation of the output and of one update, the input changed before."""
    context, size = system.CreateDefaultContext(), system.get_input_port(0).size()
    source, port = system.get_input_port(0), system.GetOutputPort(output)
    rows = f"{name}, output", f"{name}, update"

    def times():
        seconds = np.zeros((SAMPLES, 2))
        for k in range(SAMPLES):
            source.FixValue(context, np.sin(0.01 * k + np.arange(size)))
            start = time.perf_counter()
            port.Eval(context)
            seen = time.perf_counter()
            if system.num_discrete_state_groups():
                values = system.EvalUniquePeriodicDiscreteUpdate(context)
                seconds[k] = seen - start, time.perf_counter() - seen
                context.SetDiscreteState(values)
            else:
                seconds[k, 0] = seen - start
        return dict(zip(rows, seconds.T, strict=True))

    require(dict(zip(rows, goals, strict=True)), times)


SPECS = {
    "encoder": (SensorSpec(noise=1e-5, resolution=1e-5), ()),
    "all of it": (SensorSpec(noise=1e-5, resolution=1e-5, scale=1.1, bias=0.1, dropout=0.01), ()),
    "late": (SensorSpec(noise=1e-5, latency=4e-3), ()),
    "failing": (SensorSpec(noise=1e-5), (SensorFault("frozen", 1.0, 0.1), SensorFault("nan", 2.0, 0.1))),
}


@pytest.mark.parametrize("size", [6, 18])
@pytest.mark.parametrize("name", SPECS)
def test_a_sensor_is_no_slower_than_its_bound(name, size):
    spec, faults = SPECS[name]
    require_times(f"Sensor {name!r}, {size} channels", Sensor(size, spec, TICK, faults), "reading", (9e-6, 12e-6))


@pytest.mark.parametrize("size", [6, 18])
def test_the_filter_is_no_slower_than_its_bound(size):
    name = f"SavitzkyGolayFilter, {size} signals, window 80, all derivatives"
    require_times(name, SavitzkyGolayFilter(size, 80, 2, TICK), "estimate", (2e-6, 9e-6))


@pytest.mark.parametrize("robot", ["hrp2_like_leg", "hrp2_like"])
@pytest.mark.parametrize("kind", ["force_torque", "joint_torque"])
def test_reaction_sensors(robot, kind):
    described = load_robot(f"{models[0]}/hrp2_like/{robot}.yaml")
    plant = make_plant(described, TICK)
    if kind == "force_torque":
        system = ForceTorque(plant, described, SensorSpec(noise=0.1), Sampling(TICK))
    else:
        system = JointTorque(plant, described, SensorSpec(), Sampling(TICK))
    context = system.CreateDefaultContext()
    forces = [SpatialForce(np.ones(3), np.ones(3)) for _ in range(plant.num_joints())]
    source, port = system.get_input_port(0), system.get_output_port()
    value = Value[list[SpatialForce]](forces)
    row = f"{type(system).__name__} of {robot}, {plant.num_joints()} joints in the plant, output"

    def outputs():
        seconds = []
        for _ in range(SAMPLES):
            source.FixValue(context, value)
            start = time.perf_counter()
            port.Eval(context)
            seconds.append(time.perf_counter() - start)
        return {row: seconds}

    require({row: 40e-6}, outputs)
