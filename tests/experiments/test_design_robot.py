"""A robot's motion keeps its limits and the distance between its links, and identifies more than sinusoids do."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from drake_tc.errors import ParamsError
from drake_tc.experiments.design.robot import RobotOptions, _sentences, design_robot, robot_limits
from drake_tc.experiments.design.robot_goal import RobotNoise, a_optimality, d_optimality, robot_goal
from drake_tc.experiments.design.robot_search import Collisions
from drake_tc.robot.plant import add_robot, joint_limits
from drake_tc.robot.rigid_regressor import link_model
from drake_tc.robot.robot import load_robot

QUICK = RobotOptions(duration=10.0, starts=1, iterations=12, distance=0.02)


def link(name, mass, length):
    return f"""<link name="{name}"><inertial><origin xyz="0 0 {length / 2}"/><mass value="{mass}"/>
<inertia ixx="0.02" iyy="0.02" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 {length / 2}"/><geometry>
<box size="0.06 0.06 {length - 0.1}"/></geometry></collision></link>"""


def joint(name, parent, child, axis, height):
    return f"""<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="0 0 {height}"/><axis xyz="{axis}"/><limit lower="-2.6" upper="2.6" velocity="2" effort="60"/></joint>"""


@pytest.fixture
def arm(tmp_path):
    """Three links that can fold back onto the first one."""
    parts = [
        link("base", 5.0, 0.4), link("upper", 3.0, 0.4), link("fore", 2.0, 0.4), link("hand", 1.0, 0.4),
        joint("turn", "base", "upper", "0 0 1", 0.4), joint("bend", "upper", "fore", "0 1 0", 0.4),
        joint("fold", "fore", "hand", "0 1 0", 0.4),
    ]  # fmt: skip
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm">{"".join(parts)}</robot>', encoding="utf-8")
    (tmp_path / "arm.yaml").write_text(
        "name: arm\nurdf: arm.urdf\nbase: base\nfixed_base: true\njoints: [turn, bend, fold]\n", encoding="utf-8"
    )
    return load_robot(tmp_path / "arm.yaml")


def distance(robot, q):
    """Smallest signed distance of all candidate pairs, straight from Drake's geometry queries."""
    builder = DiagramBuilder()
    plant, graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    add_robot(plant, robot, collisions=True, rotors=False)
    plant.Finalize()
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyContextFromRoot(context), q)
    assert isinstance(graph, SceneGraph)
    query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(context))
    return min(pair.distance for pair in query.ComputeSignedDistancePairwiseClosestPoints(10.0))


def test_the_distance_constraint_agrees_with_the_geometry(arm):
    constraint = Collisions(arm, 0.02)
    assert constraint.pairs
    for q in (np.zeros(3), np.array([0.3, 1.0, -0.5]), np.array([0.0, 2.5, 2.5])):
        assert constraint.allows(q[None]) == (distance(arm, q) >= 0.02)


def test_the_slope_of_the_distance_is_that_of_finite_differences(arm):
    constraint = Collisions(arm, 0.3)
    q = np.array([0.2, 1.6, 1.2])
    value, slope = constraint.gradient(q)
    assert_allclose(value, constraint.value(q), rtol=1e-9)
    step = 1e-6
    expected = [(constraint.value(q + step * e) - constraint.value(q - step * e)) / (2 * step) for e in np.eye(3)]
    assert_allclose(slope, expected, atol=1e-4 * max(1.0, float(np.abs(expected).max())))


def test_a_designed_motion_keeps_limits_and_distances_and_identifies_more(arm):
    design = design_robot(arm, robot_limits(arm), replace(QUICK, starts=4))  # one start may end in a poor optimum
    time, motions = design.motion(50.0)
    assert set(motions) == {"turn", "bend", "fold"} and time[-1] > 10.0
    limits = joint_limits(arm)
    for i, name in enumerate(arm.joints):
        motion = motions[name]
        assert limits.lower[i] <= motion[0].min() and motion[0].max() <= limits.upper[i]
        assert np.abs(motion[1]).max() <= limits.velocity[i] * (1.0 + 1e-6)
        assert_allclose(motion[1:3, [0, -1]], 0.0, atol=1e-6)
        assert np.abs(np.diff(motion[0])).max() <= limits.velocity[i] / 50.0 * 1.02  # no step where the parts join
    q = np.stack([motions[name][0] for name in arm.joints], axis=-1)
    lead = np.flatnonzero((time > 5.0) & (time < time[-1] - 5.0))[::7]
    assert min(distance(arm, each) for each in q[lead]) > 0.0
    ratio = np.median([e.after / e.default for e in design.expected])
    assert ratio < 0.6, ratio
    assert design.value >= design.start_value - 1e-9


def test_a_posture_in_which_links_touch_is_refused(arm, tmp_path):
    text = (tmp_path / "arm.yaml").read_text(encoding="utf-8") + "posture: {bend: 2.55, fold: 2.55}\n"
    (tmp_path / "folded.yaml").write_text(text, encoding="utf-8")
    folded = load_robot(tmp_path / "folded.yaml")
    with pytest.raises(ParamsError, match="links are closer than"):
        design_robot(folded, robot_limits(folded), QUICK)


TABLE = """<sdf version="1.7"><model name="table"><static>{static}</static><pose>0.6 0 {height} 0 0 0</pose>
<link name="top"><collision name="c">
<geometry><box><size>0.8 2 0.04</size></box></geometry></collision></link></model></sdf>"""


@pytest.mark.parametrize("static", ["true", "false"])
def test_a_motion_keeps_its_distance_from_a_table(arm, tmp_path, static):
    """The arm bends forward into a table at 0.75 m, whose top is at 0.77 m; its links are 0.06 m thick."""
    scene = tmp_path / "table.sdf"
    scene.write_text(TABLE.format(static=static, height=0.75), encoding="utf-8")
    alone, beside = Collisions(arm, 0.02), Collisions(arm, 0.02, scene)
    bent = np.array([0.0, 1.5, 0.3])  # the forearm lies at 0.8 m, the hand goes down from it through the table
    assert beside.pairs > alone.pairs
    assert alone.allows(bent[None]) and not beside.allows(bent[None])
    assert beside.allows(np.zeros((1, 3)))
    value, slope = beside.gradient(bent)
    step = 1e-6
    expected = [(beside.value(bent + step * e) - beside.value(bent - step * e)) / (2 * step) for e in np.eye(3)]
    assert_allclose(slope, expected, atol=1e-4 * max(1.0, float(np.abs(expected).max())))
    assert value > 1.0


def test_a_designed_motion_stays_off_the_table(arm, tmp_path):
    scene = tmp_path / "table.sdf"
    scene.write_text(TABLE.format(static="true", height=0.75), encoding="utf-8")
    design = design_robot(arm, robot_limits(arm), replace(QUICK, scene=scene))
    q = np.stack([basis.motion(x)[0] for basis, x in zip(design.bases, design.x, strict=True)], axis=-1)
    assert Collisions(arm, 0.015, scene).allows(q[::3])
    assert np.ptp(q, axis=0).min() > 0.1


@pytest.mark.parametrize(
    ("text", "words"),
    [("<sdf", "expected a URDF, SDF or MJCF"), (TABLE.replace("collision", "visual"), "no collision shape")],
)
def test_a_scene_that_is_none_is_one_line(arm, tmp_path, text, words):
    scene = tmp_path / "table.sdf"
    scene.write_text(text.format(static="true", height=0.75) if "{" in text else text, encoding="utf-8")
    with pytest.raises(ParamsError, match=words) as found:
        Collisions(arm, 0.02, scene)
    assert "\n" not in str(found.value)


@pytest.fixture
def mesh_arm(arm, tmp_path):
    """The same arm with a mesh in place of every box, as the URDFs of most arms have."""
    text = re.sub(r'<box size="[^"]*"/>', '<mesh filename="link.stl"/>', arm.urdf.read_text(encoding="utf-8"))
    (tmp_path / "arm.urdf").write_text(text, encoding="utf-8")
    return load_robot(tmp_path / "arm.yaml")


def test_a_robot_whose_shapes_are_meshes_is_told_that_no_distance_was_kept(mesh_arm):
    design = design_robot(mesh_arm, robot_limits(mesh_arm), QUICK)
    text = " ".join(design.sentences)
    assert (
        "No distance between links was kept" in text
        and "meshes, which the design does not use: base, upper, fore, hand." in text
    )
    assert "Check the motion for collisions" in text


def test_a_robot_with_shapes_is_told_nothing(arm):
    assert Collisions(arm, 0.02).sentences == ()


def test_a_scene_beside_a_robot_without_shapes_is_refused(mesh_arm, tmp_path):
    scene = tmp_path / "table.sdf"
    scene.write_text(TABLE.format(static="true", height=0.75), encoding="utf-8")
    with pytest.raises(ParamsError, match="no distance from the scene can be kept") as found:
        Collisions(mesh_arm, 0.02, scene)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
@pytest.mark.parametrize("name", ["velocity", "acceleration", "jerk", "torque", "bandwidth_hz"])
def test_a_limit_of_a_robot_that_is_not_positive_is_refused(arm, name, value):
    with pytest.raises(ParamsError, match=f"{name}: expected a positive limit"):
        robot_limits(arm, **{name: value})


def test_a_rotor_whose_inertia_is_fitted_takes_part_unless_a_link_imitates_it(arm):
    """The inertia of the links about the first axis imitates the rotor of the first joint, and none of the others."""
    plain = design_robot(arm, robot_limits(arm), QUICK)
    design = design_robot(arm, robot_limits(arm), replace(QUICK, rotors=arm.joints))
    rows = {each.name.removesuffix(", half 95 % interval"): each for each in design.expected}
    rotors = {name for name in rows if name.endswith("rotor_inertia")}
    assert rotors and "turn/rotor_inertia" not in rotors
    assert len(design.expected) == len(plain.expected) + len(rotors)
    assert all(0.0 < rows[name].after < 10.0 for name in rotors)
    assert f"rotor inertias ({len(rotors)})" in design.sentences[0]


def goal_of(arm, **changes):
    links = link_model(arm)
    goal = robot_goal(links, robot_limits(arm), 10.0, np.random.default_rng(0), (0, 1, 2))
    return replace(goal, **changes)


def test_the_slopes_by_the_motion_are_those_of_differences(arm):
    """With torques beyond the limits, so that the penalty counts too."""
    goal = goal_of(arm, effort=np.array([2.0, 20.0, 4.0]))
    assert goal.rotors
    reference = np.random.default_rng(1).uniform(0.5, 2.0, goal.units.size)
    rng = np.random.default_rng(2)
    motion = tuple(rng.normal(size=(30, 3)) for _ in range(3))
    for criterion in (d_optimality, a_optimality(reference, tuple(goal.groups.values()))):
        value, slopes = goal.value_and_slopes(criterion, motion)
        assert_allclose(value, goal.value(criterion, motion), rtol=1e-12)
        for order in range(3):
            change = np.zeros((3, 30, 3))
            change[order] = 1e-6 * rng.uniform(0.5, 1.0, (30, 3)) * np.sign(slopes[order])  # no sum that cancels
            up, down = (
                goal.value(criterion, tuple(m + s * c for m, c in zip(motion, change, strict=True))) for s in (1, -1)
            )
            # forward differences of 1e-6 against a central one
            assert_allclose(np.sum(slopes * change), 0.5 * (up - down), rtol=1e-4)


def test_intervals_are_in_proportion_to_the_noise_and_the_motion_is_not_changed(arm):
    goal = goal_of(arm)
    noisy = RobotNoise(2.0 * goal.noise.torque, 0.25 * goal.noise.per_second)  # powers of 2: same rounding
    short = replace(QUICK, iterations=4)
    quiet, loud, none = (
        design_robot(arm, robot_limits(arm), replace(short, noise=each)) for each in (goal.noise, noisy, None)
    )
    assert_allclose(loud.x, quiet.x, atol=1e-4)
    assert_allclose([e.after for e in loud.expected], [4.0 * e.after for e in quiet.expected], rtol=1e-3)
    assert "The intervals assume the noise of the given logs." in quiet.sentences
    assert any("because no log was given" in each for each in none.sentences)


@pytest.mark.slow
def test_no_group_of_parameters_is_identified_worse_than_by_sinusoids(arm):
    """D-optimality gives up Coulomb friction for base parameters."""
    options = replace(QUICK, duration=15.0, iterations=30)
    ratios = {}
    for name in ("intervals", "D"):
        made = design_robot(arm, robot_limits(arm), replace(options, criterion=name))
        ratios[name] = {e.name.partition(",")[0]: e.after / e.default for e in made.expected}
    coulomb = {name: max(r for key, r in each.items() if "coulomb" in key) for name, each in ratios.items()}
    friction = [r for key, r in ratios["intervals"].items() if "viscous" in key or "coulomb" in key]
    base = [
        r for key, r in ratios["intervals"].items() if key.count("/") and "viscous" not in key and "coulomb" not in key
    ]
    assert np.median(friction) < 1.0 and np.median(base) < 0.6, (friction, base)
    assert coulomb["intervals"] < coulomb["D"], coulomb


@pytest.mark.parametrize("value", [1.3, 2.0])
def test_a_group_that_sinusoids_identify_better_is_named(arm, value):
    goal = goal_of(arm)
    ratios = np.full(goal.units.size, 0.5)
    ratios[goal.groups["friction coefficients"]] = value
    text = _sentences(goal, ratios, None)
    assert "Growing sinusoids identify the friction coefficients better." in text
    assert f"{value:.2g} for the friction coefficients (6)" in text[0]
