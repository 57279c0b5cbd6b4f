"""The compiled dynamics against pinocchio's, which share no line with Drake's.

Pinocchio's free joint counts its velocity u = [v; omega] in the base's own axes, v_ours = T u, T = [0 R; R 0]. As R
turns, vdot_ours = T udot + d with d = [0; omega x v], so that M_u = T^T M T and h_u = T^T (h + M d).
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tsid.machines import machine, random_state

from drake_tc.robot.urdf import reduced_urdf
from drake_tc.tsid.model import TsidModel

pin = pytest.importorskip("pinocchio", reason="pip install pin")

NAMES = ("humanoid", "shuffled humanoid", "leg", "arm", "floating arm", "talos")
"""Not the iCub: without rotors, whose inertia pinocchio does not have here, its mass matrix is singular."""


class Other:
    """The robot with a free base in pinocchio, at the same state."""

    def __init__(self, model, q, v):
        robot = model.robot
        self.model = pin.buildModelFromXML(reduced_urdf(robot), pin.JointModelFreeFlyer())
        joints = [self.model.joints[self.model.getJointId(name)] for name in robot.joints]
        if self.model.nv != model.n + 6 or self.model.names[1] != "root_joint":
            pytest.skip("its base is not the root of the URDF")
        pose = robot.base_pose.transform
        base = np.concatenate([pose.translation(), pose.rotation().ToQuaternion().wxyz()[[1, 2, 3, 0]]])
        omega, speed = np.zeros(3), np.zeros(3)
        if not robot.fixed_base:
            base, omega, speed = np.concatenate([q[4:7], q[[1, 2, 3, 0]]]), v[:3], v[3:6]
        turn = pin.Quaternion(base[3:]).toRotationMatrix()
        self.q, self.u = np.zeros(self.model.nq), np.zeros(self.model.nv)
        self.q[:7] = base
        self.u[:6] = np.concatenate([turn.T @ speed, turn.T @ omega])
        columns = [joint.idx_v for joint in joints]
        self.q[[joint.idx_q for joint in joints]], self.u[columns] = q[model.positions], v[model.actuated]
        skip = 0 if robot.fixed_base else 6
        self.into = np.zeros((model.nv, self.model.nv))
        self.into[model.actuated, columns] = 1.0
        self.drift = np.zeros(model.nv)
        if skip:
            self.into[:3, 3:6] = self.into[3:6, :3] = turn
            self.drift[3:6] = np.cross(omega, speed)
        self.data = self.model.createData()
        self.used = slice(6 - skip, None)


def near(found, expected):
    assert_allclose(found, expected, rtol=0, atol=1e-11 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", NAMES)
def test_mass_matrix_bias_and_frames_are_pinocchios(name, seed, tmp_path):
    held = machine(name, tmp_path)
    model = TsidModel(held.robot, held.contacts, rotor_inertia={})
    q, v = random_state(model, seed)
    terms, other = model.terms(model.create_scratch(), q, v), Other(model, q, v)
    into, used = other.into[:, other.used], other.used
    mass = pin.crba(other.model, other.data, other.q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    near(into.T @ terms.mass_matrix @ into, mass[used, used])
    load = pin.nonLinearEffects(other.model, other.data, other.q, other.u)
    near(into.T @ (terms.bias + terms.mass_matrix @ other.drift), load[used])
    rest = -other.into.T @ other.drift
    pin.forwardKinematics(other.model, other.data, other.q, other.u, rest)
    pin.computeJointJacobians(other.model, other.data, other.q)
    aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for contact in model.contacts:
        index, found = other.model.getFrameId(contact.frame.link), terms.frame(contact.frame.link)
        pin.updateFramePlacement(other.model, other.data, index)
        near(found.position, other.data.oMf[index].translation)
        near(found.rotation, other.data.oMf[index].rotation)
        jacobian = pin.getFrameJacobian(other.model, other.data, index, aligned)[[3, 4, 5, 0, 1, 2]]
        near(found.jacobian @ into, jacobian[:, used])
        angular = pin.getFrameAcceleration(other.model, other.data, index, aligned).angular
        linear = pin.getFrameClassicalAcceleration(other.model, other.data, index, aligned).linear
        near(found.bias, np.concatenate([angular, linear]))
