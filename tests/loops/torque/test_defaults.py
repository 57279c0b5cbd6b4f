"""Defaults fit the robot at hand: gains and window leave margins, the guard passes the rated torque."""

import logging
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.wiring import sliding
from drake_tc.analysis.sampled import linearise, loop_margins, open_loop
from drake_tc.control.gains import TorqueGains
from drake_tc.control.trajectories import knot_trajectory
from drake_tc.errors import ParamsError
from drake_tc.estimation.disturbance_observer import PredictorSpec
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.torque.coupling import coupling
from drake_tc.loops.torque.default_gains import joint_loops, tied_loops
from drake_tc.loops.torque.scenario import TorqueLoopSpec
from drake_tc.loops.torque.wiring import add_torque_loop, torque_controller
from drake_tc.robot.plant import joint_limits, make_plant
from drake_tc.robot.robot import load_robot
from tests.robot_files import joint_tag, link_tag, urdf, write_robot


@pytest.fixture
def arm(tmp_path):
    """Heavy upper arm, light wrist: with the servo's stiffness and Kp = 2 behind 80 samples its loop is unstable."""
    text = urdf(
        link_tag("upper", (0.3, 0, 0), 12.0, (0.1, 0.4, 0.4)),
        link_tag("fore", (0.25, 0, 0), 6.0, (0.02, 0.15, 0.15)),
        link_tag("hand", (0.0, 0, -0.05), 0.8, (0.002, 0.002, 0.001)),
        joint_tag("shoulder", "base", "upper", axis=(0, 0, 1)),
        joint_tag("elbow", "upper", "fore", axis=(0, 1, 0), xyz=(0.6, 0, 0)),
        joint_tag("wrist", "fore", "hand", axis=(1, 0, 0), xyz=(0.5, 0, 0)),
    )
    return load_robot(write_robot(tmp_path, text, ["shoulder", "elbow", "wrist"]))


def models_of(robot, rated_torques=(150.0, 80.0, 30.0)):
    return {
        joint: ActuatorModel(
            joint,
            Drive("position_servo", 0.02 / rated),
            (
                EffectValue("viscous", {"viscous": 0.1 * rated}),
                EffectValue("coulomb", {"coulomb": 0.04 * rated}),
                EffectValue("rotor_inertia", {"rotor_inertia": 0.005 * rated}),
            ),
        )
        for joint, rated in zip(robot.joints, rated_torques, strict=True)
    }


def built(robot, models, reference=None, spec=None, **options):
    builder = DiagramBuilder()
    plant = add_robot_plant(builder, robot)
    loop = add_torque_loop(builder, plant, robot, models, reference, spec, **options)
    log = loop.add_log(builder, "joint_state", "command", "encoder", "flags", "mode")
    return loop, builder.Build(), log


def radius(robot, models, spec, gains):
    """Largest |z| of the whole diagram in sliding: Drake's own step, linearised."""
    loose = replace(TorqueLoopSpec() if spec is None else spec, sensors="perfect")
    _, diagram, _ = built(robot, sliding(models), None, loose, gains=gains)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(1.2)
    return linearise(diagram, simulator.get_context(), loose.dt).spectral_radius


def assert_margins(design):
    """Every joint's loop alone has a gain margin of 2 and a phase margin of 40 degrees."""
    for joint, each in joint_loops(design).items():
        found = each.margins()
        assert max(found.gain_margin, 1.0 / found.gain_margin) >= 2.0 * 0.999, joint
        assert math.degrees(abs(found.phase_margin)) >= 39.9, joint


def test_default_gains_and_window_leave_every_joint_its_margins(arm, caplog):
    models = models_of(arm)
    with caplog.at_level(logging.WARNING):
        loop, _, _ = built(arm, models)
    assert caplog.text == ""
    assert_margins(loop.design)
    assert radius(arm, models, loop.design.spec, loop.design.gains) < 1.0 + 1e-9  # what is held has an eigenvalue of 1
    controller = torque_controller(arm, models)
    assert controller.GetSystems()


def without_servo(robot, kind, gain):
    """Drives of `gain` units of effort a newton metre, with little friction."""
    kept = {"viscous": 0.1, "coulomb": 0.1, "rotor_inertia": 1.0}
    return {
        joint: ActuatorModel(
            joint,
            Drive(kind, gain),
            tuple(
                EffectValue(each.key, {name: kept[each.key] * value for name, value in each.parameters.items()})
                for each in model.effects
            ),
        )
        for joint, model in models_of(robot).items()
    }


@pytest.mark.parametrize(("kind", "gain"), [("torque", 1.0), ("current", 0.02), ("current", 20.0), ("voltage", 0.1)])
def test_defaults_hold_an_arm_whose_drives_are_no_servos(arm, caplog, kind, gain):
    """Whatever the unit of their effort: stiffness is from the joints' inertias, and the guard lets weights be held."""
    models = without_servo(arm, kind, gain)
    with caplog.at_level(logging.WARNING):
        loop, diagram, log = built(arm, models)
    assert caplog.text == ""
    assert_margins(loop.design)
    same = built(arm, without_servo(arm, kind, 7.0 * gain))[0].design.gains
    assert_allclose(same.ks, loop.design.gains.ks, rtol=1e-9)  # rounding
    simulator = Simulator(diagram)
    simulator.AdvanceTo(1.0)
    signals = log.recorded(simulator.get_context())[1]
    assert np.abs(signals["joint_state"][:, :3] - arm.posture).max() < 0.05  # less than the arm falls in 0.1 s
    assert signals["flags"].max() == 0.0


@pytest.fixture(params=["parallel_axes", "gripper"])
def tied(request, tmp_path):
    """Joints whose loops disturb each other, and a gripper one of whose fingers follows the other."""
    tags = [
        link_tag("upper", (0.15, 0, 0), 3.0, (0.002, 0.03, 0.03)),
        link_tag("fore", (0.13, 0, 0), 2.0, (0.002, 0.02, 0.02)),
        joint_tag("shoulder", "base", "upper", axis=(0, 0, 1)),
        joint_tag("elbow", "upper", "fore", axis=(0, 0, 1), xyz=(0.3, 0, 0)),
    ]
    joints, rated = ["shoulder", "elbow"], (30.0, 15.0)
    if request.param == "gripper":
        tags[2:] = [joint_tag("shoulder", "base", "upper", axis=(0, 1, 0))]
        tags[1] = link_tag("left", (0, 0, -0.05), 0.4, (1e-3, 1e-3, 1e-4))
        tags.append(link_tag("right", (0, 0, -0.05), 0.4, (1e-3, 1e-3, 1e-4)))
        follows = '<mimic joint="left" multiplier="-1"/></joint>'
        tags.append(joint_tag("left", "upper", "left", axis=(1, 0, 0), xyz=(0.3, 0.05, 0)))
        right = joint_tag("right", "upper", "right", axis=(1, 0, 0), xyz=(0.3, -0.05, 0))
        tags.append(right.replace("</joint>", follows))
        joints, rated = ["shoulder", "left"], (30.0, 5.0)
    return load_robot(write_robot(tmp_path, urdf(*tags), joints)), rated


def test_default_gains_leave_every_joint_its_margins_with_the_other_loops_closed(tied, caplog):
    """Cut at the efforts of the drives in the diagram itself, as Drake steps it."""
    robot, rated = tied
    models = models_of(robot, rated)
    with caplog.at_level(logging.WARNING):
        loop, _, _ = built(robot, models)
    assert caplog.text == ""
    perfect = replace(loop.design.spec, sensors="perfect")
    _, diagram, _ = built(robot, sliding(models), None, perfect, gains=loop.design.gains)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(1.2)
    cut = open_loop(
        diagram, simulator.get_context(), perfect.dt, "torque_control:command", relative_to="torque_control:position"
    )
    for name, found in loop_margins(cut).items():
        assert max(found.gain_margin, 1.0 / found.gain_margin) >= 2.0 * 0.99, name
        assert math.degrees(abs(found.phase_margin)) >= 39.5, name
    together = tied_loops(replace(loop.design, spec=perfect)).margins()
    for one, other in zip(together, loop_margins(cut).values(), strict=True):
        assert_allclose(one.phase_margin, other.phase_margin, rtol=0.02)  # to the resolution of a grid
        assert_allclose(one.gain_margin, other.gain_margin, rtol=0.02)


@pytest.mark.parametrize(
    ("spec", "differs"),
    [
        (TorqueLoopSpec(torque_from="sensor"), "torque_from"),
        (TorqueLoopSpec(predictor=PredictorSpec()), "predictor"),
        (TorqueLoopSpec(controller="servo"), None),
    ],
)
def test_a_loop_whose_margins_are_not_known_says_so(arm, caplog, spec, differs):
    with caplog.at_level(logging.WARNING):
        torque_controller(arm, models_of(arm), None, spec)
    if differs is None:
        assert caplog.text == ""
    else:
        assert "whether the gains leave margins is not known" in caplog.text
        assert f"it differs in {differs}" in caplog.text


def test_coupling_is_that_of_drakes_plant(arm):
    at = np.array([0.3, -0.7, 1.1])
    found, plant = coupling(arm, at), make_plant(arm, 0.0)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, at)
    assert_allclose(found.inertia, plant.CalcMassMatrix(context), rtol=1e-12, atol=1e-12)
    for j in range(3):
        sides = []
        for way in (1e-4, -1e-4):
            plant.SetPositions(context, at + way * np.eye(3)[j])
            sides.append(-plant.CalcGravityGeneralizedForces(context))
        assert_allclose(found.gravity[:, j], (sides[0] - sides[1]) / 2e-4, atol=1e-5)
    assert not found.sensed_inertia.any()


def test_a_loop_without_margins_says_so(arm, caplog):
    models = models_of(arm)
    old = TorqueGains.from_servo(models)
    with caplog.at_level(logging.WARNING):
        built(arm, models, None, TorqueLoopSpec(), gains=old)
        torque_controller(arm, models, None, TorqueLoopSpec(), gains=old)
    assert len(caplog.records) == 2
    for record in caplog.records:
        assert "joint elbow: the linear loop is unstable (|z| = 1.0" in record.getMessage()
    assert radius(arm, models, TorqueLoopSpec(), old) > 1.0 + 1e-4


def test_the_guard_passes_what_the_rated_torque_needs_and_no_more(arm):
    models = models_of(arm)
    _, diagram, log = built(arm, models, knot_trajectory([0.0, 0.05], [[0.0] * 3, [1.0] * 3]))
    simulator = Simulator(diagram)
    simulator.AdvanceTo(1.0)
    _, signals = log.recorded(simulator.get_context())
    limits = joint_limits(arm)
    friction = np.array(
        [0.1 * rated * v + 0.04 * rated for rated, v in zip((150, 80, 30), limits.velocity, strict=True)]
    )
    gain = np.array([models[joint].drive.gain for joint in arm.joints])
    most = gain * (limits.effort + friction)
    assert (np.abs(signals["command"] - signals["encoder"]) <= most * (1.0 + 1e-9)).all()
    assert most.max() < 0.2


def test_a_reference_beyond_a_joints_range_is_refused_or_flagged(arm):
    models = models_of(arm)
    path = knot_trajectory([0.0, 1.0], [[0.0, 0.0, 0.0], [0.0, 3.4, 0.0]])
    with pytest.raises(ParamsError, match=r"reference: elbow: expected -3 to 3 rad, got 3\.4 at 1 s"):
        built(arm, models, path)
    builder = DiagramBuilder()
    plant = add_robot_plant(builder, arm)
    far = np.zeros(9)
    far[1] = 3.4
    source = builder.AddNamedSystem("far", ConstantVectorSource(far))
    loop = add_torque_loop(builder, plant, arm, models, source.get_output_port(), TorqueLoopSpec(sensors="perfect"))
    log = loop.add_log(builder, "flags", "mode", "joint_state")
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.6)
    _, signals = log.recorded(simulator.get_context())
    assert signals["flags"][-1, loop.flag_names.index("reference/out_of_range")] == 1.0
    assert signals["mode"][-1] >= 2.0
    assert_allclose(signals["joint_state"][-1, 1], 0.0, atol=0.6)
