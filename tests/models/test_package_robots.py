"""Robots that no one here wrote a file for: a YAML of five lines is enough."""

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose
from optional import skip_without_robots
from pydrake.systems.analysis import Simulator

from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot
from drake_tc.robot.urdf_tree import read_urdf
from drake_tc.simulator_files.urdf import resolve

ROBOTS = {  # URDF below example-robot-data/robots, base, joints that move, mass [kg] by the URDF's own <mass> tags
    "anymal": ("anymal_b_simple_description/robots/anymal.urdf", "base", 12),
    "panda": ("panda_description/urdf/panda.urdf", "panda_link0", 9),
    "solo": ("solo_description/robots/solo12.urdf", "base_link", 12),
    "romeo": ("romeo_description/urdf/romeo_small.urdf", "base_link", 31),
    "talos": ("talos_data/robots/talos_reduced.urdf", "base_link", 32),
}


@pytest.fixture(params=ROBOTS)
def case(request, tmp_path):
    urdf, base, count = ROBOTS[request.param]
    reference = f"package://example-robot-data/robots/{urdf}"
    skip_without_robots()
    path = resolve(reference, tmp_path)
    tree = read_urdf(path)
    return tmp_path, reference, base, count, tree


def written(folder, reference, base, joints, **more):
    path = folder / "robot.yaml"
    document = {"name": "robot", "urdf": reference, "base": base, "fixed_base": False, "joints": list(joints), **more}
    path.write_text(yaml.safe_dump(document))
    return load_robot(path)


def test_it_keeps_its_mass_and_falls(case):
    folder, reference, base, count, tree = case
    assert len(tree.movable) == count
    inertia = dict.fromkeys(tree.movable, 0.05)
    plant = make_plant(written(folder, reference, base, tree.movable, rotor_inertia=inertia), 1e-3)
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    mass = sum(float(tag.get("value")) for tag in tree.root.iterfind("link/inertial/mass"))
    assert_allclose(plant.CalcTotalMass(context), mass, rtol=1e-9)
    plant.get_actuation_input_port().FixValue(context, np.zeros(count))
    start = plant.CalcCenterOfMassPositionInWorld(context)
    simulator.AdvanceTo(0.5)
    assert np.isfinite(plant.GetPositionsAndVelocities(context)).all()
    fallen = plant.CalcCenterOfMassPositionInWorld(context) - start
    assert_allclose(fallen, [0, 0, -0.5 * 9.81 * 0.5 * 0.501], atol=5e-3)


def test_half_of_its_joints_locked_is_the_same_machine(case):
    folder, reference, base, _, tree = case
    listed = tree.movable[::2]
    random = np.random.default_rng(1)
    reach = {name: (max(tree.joints[name].lower, -1.0), min(tree.joints[name].upper, 1.0)) for name in tree.movable}
    at = {name: float(random.uniform(*sorted(reach[name]))) for name in tree.movable}
    locked = {name: at[name] for name in tree.movable if name not in listed}
    full = make_plant(written(folder, reference, base, tree.movable), 1e-3)
    part = make_plant(written(folder, reference, base, listed, locked=locked), 1e-3)
    terms = []
    for plant in (full, part):
        context = plant.CreateDefaultContext()
        q, kept = plant.GetPositions(context), list(range(6))
        for name in tree.movable:
            joint = plant.GetJointByName(name)
            if joint.num_velocities():
                q[joint.position_start()] = at[name]
        for name in listed:
            kept.append(plant.GetJointByName(name).velocity_start())
        plant.SetPositions(context, q)
        mass, gravity = plant.CalcMassMatrix(context), plant.CalcGravityGeneralizedForces(context)
        terms.append((mass[np.ix_(kept, kept)], gravity[kept], plant.CalcCenterOfMassPositionInWorld(context)))
    for whole, reduced in zip(*terms, strict=True):
        assert_allclose(reduced, whole, rtol=1e-9, atol=1e-9 * np.abs(whole).max())
