"""Models in steady sliding: what a loop built with them has in its linearisation."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.actuation.wiring import sliding
from drake_tc.errors import ParamsError

VISCOUS, GAIN, SWITCH = 0.3, 0.5, 0.25
KNEE = ActuatorModel(
    "knee",
    Drive("current", GAIN),
    (
        EffectValue("viscous", {"viscous": VISCOUS}),
        EffectValue("coulomb", {"coulomb": 2.0}),
        EffectValue("deadzone", {"deadzone": 0.1}),
        EffectValue("velocity_sign_switch", {"switch": SWITCH}),
        EffectValue("rotor_inertia", {"rotor_inertia": 0.02}),
    ),
)


def torque(models, effort, velocity):
    """[N m] of the actuator system that moves at this velocity under this effort."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(ActuatorPlant(models, 1e-3, 0.5))
    motion = PiecewisePolynomial.FirstOrderHold([0.0, 1.0], np.array([[0.0, velocity]]))
    sources = {"command": ConstantVectorSource(np.array([effort])), "state": TrajectorySource(motion, 1)}
    for port, source in sources.items():
        builder.Connect(builder.AddSystem(source).get_output_port(), plant.GetInputPort(port))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.05)  # the bristle of dry friction is wound up by then
    return float(plant.GetOutputPort("actuation").Eval(plant.GetMyContextFromRoot(simulator.get_context()))[0])


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_slope_of_the_torque_is_that_of_the_whole_model_in_sliding(direction):
    """Over the effort, beyond the dead zone: what dry friction and dead zone add is a constant."""
    speed, efforts = 0.4 * direction, (1.0, 2.0)
    slopes = []
    for models in ({"knee": KNEE}, sliding([KNEE], direction)):
        one, two = (torque(models, direction * effort, speed) for effort in efforts)
        slopes.append(direction * (two - one))
    assert_allclose(slopes[1], slopes[0], rtol=1e-9)
    assert abs(slopes[0] - 1.0 / GAIN) > 0.2  # the switch acts


def test_dry_friction_is_gone_and_the_rest_is_as_it_was():
    models = sliding({"knee": KNEE})
    assert [value.key for value in models["knee"].effects] == ["viscous", "rotor_inertia"]
    assert models["knee"].inertia == KNEE.inertia
    assert torque(models, 0.0, 1e-6) == pytest.approx(0.0, abs=1e-5)
    assert abs(torque({"knee": KNEE}, 0.0, 1e-1)) > 1.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([KNEE], 0.5), "expected a direction of 1, -1 or 0, got 0.5"),
        (([],), "models is empty"),
        ((["knee"],), "got 'knee'"),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(ParamsError, match=message):
        sliding(*arguments)
