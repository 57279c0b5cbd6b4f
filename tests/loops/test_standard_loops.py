"""The standard loops in one call: what they connect, how a stage is replaced, and what is put between two."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LinearSystem

import drake_tc.models
from drake_tc.actuation.model_file import load_models
from drake_tc.control.gains import TorqueGains
from drake_tc.control.trajectories import knot_trajectory
from drake_tc.errors import ParamsError
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.series_elastic.scenario import SeriesElasticLoopSpec
from drake_tc.loops.series_elastic.wiring import add_series_elastic_loop
from drake_tc.loops.torque.scenario import TorqueLoopSpec
from drake_tc.loops.torque.wiring import add_torque_loop, torque_controller
from drake_tc.loops.whole_body.scenario import WholeBodySpec
from drake_tc.loops.whole_body.wiring import add_whole_body_loop, whole_body_controller
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import load_robot
from drake_tc.tsid.configuration import load_law

MODELS = Path(drake_tc.models.__file__).parent
LEG = MODELS / "hrp2_like" / "hrp2_like_leg.yaml"
N = 6
GAINS = TorqueGains(*[np.ones(N)] * 4)
"""Given where they do not matter, as the default ones are searched for."""


def scaled(size, factor):
    """y = factor u."""
    nil = np.zeros((0, size))
    return LinearSystem(np.zeros((0, 0)), nil, nil.T, factor * np.eye(size), 1e-3)


class Pusher(LeafSystem):
    """A torque control of one's own: command = q + K tau_d."""

    def __init__(self, gain):
        super().__init__()
        self._gain = gain
        self._torque = self.DeclareVectorInputPort("desired_torque", N)
        self._position = self.DeclareVectorInputPort("position", N)
        self._reference = self.DeclareVectorInputPort("reference", 3 * N)
        self.DeclareVectorOutputPort("command", N, self._write)

    def _write(self, context, vector):
        vector.SetFromVector(self._position.Eval(context) + self._gain * self._torque.Eval(context))


def leg_loop(reference=None, spec=None, *, gains=GAINS, **options):
    robot = load_robot(LEG)
    builder = DiagramBuilder()
    plant = add_robot_plant(builder, robot)
    loop = add_torque_loop(builder, plant, robot, load_models(robot.actuators), reference, spec, gains=gains, **options)
    log = loop.add_log(builder, "joint_state", "reference", "command", "desired_torque", "encoder")
    return loop, builder.Build(), log


def run(diagram, log, duration=0.3):
    simulator = Simulator(diagram)
    simulator.AdvanceTo(duration)
    return log.recorded(simulator.get_context())


def test_the_torque_loop_follows_a_trajectory():
    posture = load_robot(LEG).posture
    path = knot_trajectory([0.3, 0.8], np.array([posture, posture + np.array([0, 0, -0.2, 0.3, -0.1, 0])]))
    loop, diagram, log = leg_loop(path, TorqueLoopSpec(sensors="perfect"), gains=None)
    time, signals = run(diagram, log, 1.1)
    error = (signals["reference"] - np.hstack((signals["joint_state"], np.zeros((time.size, N)))))[:, :N]
    assert np.abs(error).max() < 0.03
    assert np.abs(error[-1]).max() < 5e-3
    assert set(loop.systems) >= {
        "filter",
        "torque_estimator",
        "inverse_dynamics",
        "torque_control",
        "guard",
        "actuators",
    }
    assert loop.flag_names[0] == "encoder/missing"


def test_a_stage_is_replaced_by_a_system_with_the_ports_that_it_needs():
    models = load_models(load_robot(LEG).actuators)
    gain = np.array([model.drive.gain for model in models.values()])
    own = Pusher(gain)
    loop, diagram, log = leg_loop(stages={"torque_control": own})
    assert loop.systems["torque_control"] is own
    _, signals = run(diagram, log, 0.6)
    assert_allclose(signals["command"][-1], (signals["encoder"] + gain * signals["desired_torque"])[-1], atol=1e-12)


def test_a_system_between_two_stages_changes_what_passes():
    """A factor on the feedforward as on the feedback: with Kp = 0 and Ks = 0 the torque is that of the reference."""
    free = TorqueGains(np.zeros(N), np.zeros(N), np.zeros(N), np.zeros(N))
    spec = TorqueLoopSpec(sensors="perfect", tare=0.0)
    torques = []
    for between in ({}, {"inverse_dynamics.desired_torque": scaled(N, 0.5)}):
        _, diagram, _ = leg_loop(None, spec, gains=free, stages=between)
        context = diagram.CreateDefaultContext()
        place = diagram.GetSubsystemByName("torque_control").GetInputPort("desired_torque")
        torques.append(place.Eval(place.get_system().GetMyContextFromRoot(context)))
    assert np.abs(torques[0]).max() > 1.0
    assert_allclose(torques[1], 0.5 * torques[0], rtol=1e-12)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stages": {"guards": Pusher(1.0)}}, r"stages: no stage or port 'guards' in this loop; stages: filter, "),
        ({"stages": {"guard.comand": scaled(N, 1.0)}}, r"no stage or port 'guard.comand' .*; ports: .*guard.command"),
        ({"stages": {"guard.command": scaled(2, 1.0)}}, r"'guard.command': expected a system .* size 6, got sizes 2"),
        ({"stages": {"guard": scaled(N, 1.0)}}, r"stages: 'guard': expected a system with an output port 'command'"),
        ({"controller_models": {}}, "models is empty"),
        ({"spec": TorqueLoopSpec(sensors="noisy")}, "noisy"),
        ({"reference": knot_trajectory([0.0, 1.0], [[0.0], [1.0]])}, "reference: expected a port of size 18"),
    ],
)
def test_what_does_not_fit_the_loop_is_refused(options, message):
    with pytest.raises(ParamsError, match=message):
        leg_loop(**options)


def sliding_models():
    return {j: replace(model, joint_type="prismatic") for j, model in load_models(load_robot(LEG).actuators).items()}


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda robot, models: TorqueLoopSpec(seed=-1), r"^seed: expected a whole number from 0 to 2\^64 - 1, got -1$"),
        (lambda robot, models: WholeBodySpec(seed=1.5), r"^seed: expected a whole number .* got 1\.5$"),
        (
            lambda robot, models: add_robot_plant(DiagramBuilder(), robot, -1e-3),
            r"^step: expected .* >= 0 \[s\], got -0",
        ),
        (
            lambda robot, models: leg_loop(gains=TorqueGains(*[np.ones(3)] * 4)),
            "^gains: expected 6, one per joint, got 3$",
        ),
        (
            lambda robot, models: leg_loop(gains=TorqueGains(*[np.ones(6)] * 4, kf=np.ones(4))),
            r"^gains\.kf: expected 6 rows, six per F/T sensor, got 4$",
        ),
        (
            lambda robot, models: torque_controller(robot, sliding_models()),
            r"^models: joint 'r_hip_yaw' is revolute in hrp2_like_leg\.urdf; its model has joint_type: prismatic$",
        ),
    ],
)
def test_what_cannot_be_is_one_line(call, message):
    robot = load_robot(LEG)
    with pytest.raises(ParamsError, match=message):
        call(robot, load_models(robot.actuators))


def test_a_plant_with_sampled_ports_is_refused():
    robot = load_robot(LEG)
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(1e-3))
    add_robot(plant, robot)
    with pytest.raises(ParamsError, match="expected a finalized plant"):
        add_torque_loop(builder, plant, robot, load_models(robot.actuators))
    plant.Finalize()
    with pytest.raises(ParamsError, match=r"call plant.SetUseSampledOutputPorts\(False\) before"):
        add_torque_loop(builder, plant, robot, load_models(robot.actuators))


def test_the_whole_body_loop_holds_the_robot_in_its_springless_drives():
    law = load_law(MODELS / "hrp2_like" / "hrp2_like_tsid.yaml")
    builder = DiagramBuilder()
    plant = add_robot_plant(builder, law.model.robot)
    with pytest.raises(ParamsError, match="models: expected actuator models, as torque: drives needs them"):
        add_whole_body_loop(builder, plant, law, WholeBodySpec(torque="drives"))
    builder = DiagramBuilder()
    plant = add_robot_plant(builder, law.model.robot)
    half = scaled(law.model.n, 0.5)
    loop = add_whole_body_loop(builder, plant, law, stages={"tsid.torque": half})
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    tsid, actuation = loop.systems["tsid"], plant.get_actuation_input_port()
    torque = tsid.get_torque_output_port().Eval(tsid.GetMyContextFromRoot(context))
    assert np.abs(torque).max() > 1.0
    assert_allclose(actuation.Eval(plant.GetMyContextFromRoot(context)), 0.5 * torque, rtol=1e-12)


def test_the_series_elastic_loop_takes_several_joints():
    robot = load_robot(MODELS / "coman_like" / "coman_like.yaml")
    models = load_models(robot.actuators)
    builder = DiagramBuilder()
    plant = add_robot_plant(builder, robot)
    n = len(robot.joints)
    desired = knot_trajectory([0.0, 0.1], [[0.0] * n, [0.5] * n])
    spec = SeriesElasticLoopSpec(delay=0.002, torque_from="deflection")
    loop = add_series_elastic_loop(builder, plant, models, desired, spec)
    log_of = loop.signals["voltage"].size(), loop.signals["measured_torque"].size()
    assert log_of == (n, n)
    log = loop.add_log(builder, "flags", "measured_torque")
    assert loop.flag_names == tuple(f"torque_control/{joint}" for joint in robot.joints)
    with pytest.raises(ParamsError, match="no signal 'fault' in this loop; signals: link_state, "):
        loop.add_log(builder, "fault")
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.01)
    time, signals = log.recorded(simulator.get_context())
    assert signals["flags"].shape == signals["measured_torque"].shape == (time.size, n)
    assert not signals["flags"].any()
    own = loop.systems["torque_control"]
    assert np.isfinite(own.get_voltage_output_port().Eval(own.GetMyContextFromRoot(simulator.get_context()))).all()


def test_ports_have_methods_by_their_names():
    loop, _, _ = leg_loop()
    guard = loop.systems["guard"]
    assert guard.get_command_output_port().get_name() == guard.get_command_input_port().get_name() == "command"
    assert "get_fault_input_port" in dir(guard)
    with pytest.raises(AttributeError, match="no output port 'comand'; its ports: command, mode, next"):
        guard.get_comand_output_port()
    with pytest.raises(AttributeError, match="has no attribute 'comand'"):
        _ = guard.comand


def test_drives_whose_rotors_are_not_those_of_the_law_are_refused():
    """The law computes its torques with the rotors: with others it accelerates another robot."""
    law = load_law(MODELS / "hrp2_like" / "hrp2_like_tsid.yaml")
    models = load_models(law.model.robot.actuators)
    joint = law.model.robot.joints[3]
    kept = tuple(value for value in models[joint].effects if value.key != "rotor_inertia")
    other = models | {joint: replace(models[joint], effects=kept)}
    spec = WholeBodySpec(torque="drives", state="plant")
    says = rf"the drive of '{joint}' has a reflected rotor inertia of 0 kg m\^2, the law 0\.\d+; name"
    builder = DiagramBuilder()
    plant = add_robot_plant(builder, law.model.robot)
    with pytest.raises(ParamsError, match=says):
        add_whole_body_loop(builder, plant, law, spec, models=other)
    with pytest.raises(ParamsError, match=says):
        whole_body_controller(law, other, spec=spec)
    assert whole_body_controller(law, models, spec=spec).GetOutputPort("command").size() == law.model.n
