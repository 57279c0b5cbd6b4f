"""The momentum observer against a simulated push: the closed form of a first-order filter."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, JacobianWrtVariable

from drake_tc.errors import ParamsError
from drake_tc.estimation.joint_torque import MomentumResidual
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.robot.plant import add_robot

from .machines import random_robot

DT = 1e-4
GAIN = 40.0


class Rig:
    """A discrete plant, stepped by hand; each step's readings are those of the step's start."""

    def __init__(self, robot) -> None:
        self.robot = robot
        self.plant = MultibodyPlant(DT)
        add_robot(self.plant, robot)
        imu = robot.imu[0]
        self.imu = self.plant.AddFrame(FixedOffsetFrame("imu", self.plant.GetFrameByName(imu.link), imu.pose.transform))
        self.plant.SetUseSampledOutputPorts(False)
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()
        self.joints = [self.plant.GetJointByName(name) for name in robot.joints]

    def index(self, part: str) -> list[int]:
        return [getattr(joint, f"{part}_start")() for joint in self.joints]

    def push(self, force) -> None:
        """Force at the origin of link l8, world axes."""
        applied = ExternallyAppliedSpatialForce()
        applied.body_index = self.plant.GetBodyByName("l8").index()
        applied.p_BoBq_B = np.zeros(3)
        applied.F_Bq_W = SpatialForce(np.zeros(3), force)
        port = self.plant.get_applied_spatial_force_input_port()
        port.FixValue(self.context, Value[list[ExternallyAppliedSpatialForce]]([applied]))

    def imu_estimate(self) -> np.ndarray:
        R_WI = self.imu.CalcPoseInWorld(self.context).rotation().matrix()
        moving = self.imu.CalcSpatialVelocityInWorld(self.context)
        speeding = self.imu.CalcSpatialAccelerationInWorld(self.context)
        proper = speeding.translational() - self.plant.gravity_field().gravity_vector()
        parts = [moving.rotational(), proper, speeding.rotational()]
        return np.concatenate([*(R_WI.T @ part for part in parts), np.zeros(3)])

    def generalized(self, force) -> np.ndarray:
        """J^T f at the joints."""
        world = self.plant.world_frame()
        jacobian = self.plant.CalcJacobianTranslationalVelocity(
            self.context, JacobianWrtVariable.kV, self.plant.GetFrameByName("l8"), np.zeros((3, 1)), world, world
        )
        return (jacobian.T @ force)[self.index("velocity")]


@pytest.mark.parametrize("fixed", [True, False])
def test_a_push_comes_through_as_a_first_order_filter(tmp_path, fixed):
    rng = np.random.default_rng(2)
    robot = random_robot(tmp_path, rng, fixed_base=fixed, sensors=1)
    rig = Rig(robot)
    model = TorqueModel(robot)
    assert not model.model.welded_to_base(model.model.plant.GetFrameByName(robot.imu[0].link))
    observer = MomentumResidual(model, GAIN, DT)
    assert not observer.HasAnyDirectFeedthrough()
    context = observer.CreateDefaultContext()
    torque = rng.uniform(-2.0, 2.0, model.size)
    rig.plant.get_actuation_input_port().FixValue(rig.context, torque)
    observer.GetInputPort("torque").FixValue(context, torque)
    force = np.array([15.0, -10.0, 20.0])
    expected, largest = np.zeros(model.size), 0.0
    for step in range(600):
        pushed = force if step >= 200 else np.zeros(3)
        rig.push(pushed)
        x = rig.plant.GetPositionsAndVelocities(rig.context)
        q, v = x[: rig.plant.num_positions()], x[rig.plant.num_positions() :]
        observer.GetInputPort("joint_state").FixValue(
            context, np.concatenate([q[rig.index("position")], v[rig.index("velocity")]])
        )
        observer.GetInputPort("imu_estimate").FixValue(context, rig.imu_estimate())
        context.SetDiscreteState(observer.EvalUniquePeriodicDiscreteUpdate(context))
        residual = observer.GetOutputPort("residual").Eval(context)
        if step:
            assert_allclose(residual, expected, atol=1e-6 * (1.0 + largest), rtol=0)
        outside = rig.generalized(pushed)
        largest = max(largest, float(np.abs(outside).max()))
        expected = outside + (expected - outside) * np.exp(-GAIN * DT)
        rig.context.SetDiscreteState(rig.plant.EvalUniquePeriodicDiscreteUpdate(rig.context))
    assert largest > 3.0
    assert np.abs(residual).max() > 0.5


def test_bad_inputs_hold_the_residual_and_start_anew(tmp_path):
    robot = random_robot(tmp_path, np.random.default_rng(2), fixed_base=True, sensors=1)
    model = TorqueModel(robot, base="fixed")
    observer = MomentumResidual(model, GAIN, DT)
    context = observer.CreateDefaultContext()
    n = model.size

    def tick(velocity) -> np.ndarray:
        observer.GetInputPort("joint_state").FixValue(context, np.concatenate([np.zeros(n), velocity]))
        observer.GetInputPort("torque").FixValue(context, np.zeros(n))
        context.SetDiscreteState(observer.EvalUniquePeriodicDiscreteUpdate(context))
        return observer.GetOutputPort("residual").Eval(context).copy()

    tick(np.zeros(n))
    before = tick(np.zeros(n))
    assert np.abs(before).max() > 0.0
    for bad in (np.nan, np.inf, 1e300):
        assert_allclose(tick(np.full(n, bad)), before, rtol=0)
    assert_allclose(tick(np.ones(n)), before, rtol=0)  # the first good sample has no difference yet
    assert np.all(np.isfinite(tick(np.ones(n))))


def test_a_known_contact_is_taken_out(tmp_path):
    rng = np.random.default_rng(9)
    robot = random_robot(tmp_path, rng, fixed_base=True, sensors=2)
    model = TorqueModel(robot, base="fixed")
    n = model.size
    q = rng.uniform(-1.0, 1.0, n)
    pushes = rng.uniform(-30.0, 30.0, 12)
    plant = MultibodyPlant(0.0)
    add_robot(plant, robot)
    plant.Finalize()
    world = plant.CreateDefaultContext()
    start = plant.GetPositions(world)
    start[[plant.GetJointByName(name).position_start() for name in robot.joints]] = q
    plant.SetPositions(world, start)
    holding = plant.CalcGravityGeneralizedForces(world) * -1.0
    base = plant.GetFrameByName(robot.base)
    for mount, push in zip(robot.force_torque, pushes.reshape(2, 6), strict=True):
        at = mount.contact.pose.transform.translation()
        jacobian = plant.CalcJacobianSpatialVelocity(
            world, JacobianWrtVariable.kV, plant.GetFrameByName(mount.contact.link), at, base, base
        )
        holding -= jacobian.T @ np.concatenate([push[3:], push[:3]])
    observer = MomentumResidual(model, GAIN, DT)
    context = observer.CreateDefaultContext()
    observer.GetInputPort("joint_state").FixValue(context, np.concatenate([q, np.zeros(n)]))
    torque = holding[[plant.GetJointByName(name).velocity_start() for name in robot.joints]]
    observer.GetInputPort("torque").FixValue(context, torque)
    observer.GetInputPort("contact_wrench").FixValue(context, pushes)
    for _ in range(50):
        context.SetDiscreteState(observer.EvalUniquePeriodicDiscreteUpdate(context))
    assert_allclose(observer.GetOutputPort("residual").Eval(context), 0.0, atol=1e-9)
    reaction = observer.GetOutputPort("base_residual").Eval(context)
    assert np.abs(reaction).max() > 1.0


def test_refusals(tmp_path):
    model = TorqueModel(random_robot(tmp_path, np.random.default_rng(0), fixed_base=True), base="fixed")
    with pytest.raises(ParamsError, match="gain: expected a positive number"):
        MomentumResidual(model, 0.0, DT)
    with pytest.raises(ParamsError, match="dt: expected a positive number"):
        MomentumResidual(model, GAIN, np.nan)
