"""The C file of a torque control computes what the stages in Python compute, compiled without a warning."""

import ctypes
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

import drake_tc.models
from drake_tc.actuation.compensator import Compensator, Motion
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import load_models
from drake_tc.control.gains import TorqueGains
from drake_tc.control.guard import GuardLaw, GuardSpec, rated_guard
from drake_tc.control.torque_control import TorqueControl
from drake_tc.control.torque_law import CompensationSpec
from drake_tc.control.trajectories import knot_trajectory
from drake_tc.effects.base import DriveEffect, SensorEffect
from drake_tc.effects.library import LIBRARY, UNCOMMON
from drake_tc.errors import ParamsError
from drake_tc.estimation.joint_torque import MomentumResidual
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.exchange.c_code import CSpec, c_function, number, to_c
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.hardware.stepper import ControllerStepper
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.torque.scenario import TorqueLoopSpec
from drake_tc.loops.torque.wiring import add_torque_loop
from drake_tc.robot.plant import joint_limits, make_plant
from drake_tc.robot.robot import load_robot

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")

LEG = Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_leg.yaml"
ROBOT = load_robot(LEG)
MODELS = load_models(ROBOT.actuators)
N, DT = 6, 1e-3
SPEC = CSpec(name="leg", kp=2.0, ki=1.5)
EFFECTS = [e for e in (*LIBRARY, *UNCOMMON) if not isinstance(e, SensorEffect)]
FLAGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2")


class Compiled:
    """The compiled file, with its state."""

    def __init__(self, files, folder):
        files.write(folder)
        library = folder / f"{files.name}.so"
        subprocess.run(
            ["cc", *FLAGS, "-shared", "-fPIC", str(folder / f"{files.name}.c"), "-o", str(library), "-lm"], check=True
        )
        self._library, self._name = ctypes.CDLL(str(library)), files.name
        size = self._library[f"{self._name}_size"]
        size.restype = ctypes.c_size_t
        self._state = ctypes.create_string_buffer(size())

    def call(self, name, *arrays, state=False):
        function = getattr(self._library, f"{self._name}_{name}")
        given = [
            each.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
            if isinstance(each, np.ndarray)
            else ctypes.c_double(each)
            for each in arrays
        ]
        return function(*([self._state] if state else []), *given)


@pytest.fixture(scope="module")
def leg(tmp_path_factory):
    return Compiled(to_c(MODELS, ROBOT, SPEC), tmp_path_factory.mktemp("leg"))


@pytest.fixture(scope="module")
def run():
    """A recorded run of the leg's simulated loop."""
    builder = DiagramBuilder()
    plant = add_robot_plant(builder, ROBOT)
    turned = np.array([np.zeros(6), [0.2, 0.1, -0.4, 0.6, -0.2, 0.1], np.zeros(6)])
    motion = knot_trajectory([0.1, 0.5, 0.9], ROBOT.posture + turned)
    loop = add_torque_loop(builder, plant, ROBOT, MODELS, motion, TorqueLoopSpec(tare=0.0))
    names = ("joint_state", "encoder", "desired_torque", "estimated_torque", "joint_estimate", "reference", "actuation")
    log = loop.add_log(builder, *names)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(1.0)
    return log.recorded(simulator.get_context())[1]


def alone(system, ports):
    """A system as a Diagram with its ports."""
    builder = DiagramBuilder()
    builder.AddNamedSystem("stage", system)
    for name in ports[0]:
        builder.ExportInput(system.GetInputPort(name), name)
    for name in ports[1]:
        builder.ExportOutput(system.GetOutputPort(name), name)
    return ControllerStepper(builder.Build(), DT, ports[1])


def test_the_filter_of_a_recorded_run(leg, run):
    """The estimate of the C file belongs to the sample of its call, that of the system to the sample before."""
    positions = run["encoder"].copy()
    positions[200:203, 2] = np.nan
    stage = alone(SavitzkyGolayFilter(N, SPEC.window, SPEC.order, DT), (["signal"], ["estimate"]))
    leg.call("init", state=True)
    found = []
    for position in positions:
        found.append(np.empty(3 * N))
        leg.call("filter", position.copy(), found[-1], state=True)
    expected = np.array([stage.tick({"signal": position})["estimate"] for position in positions])[1:]
    scale = np.abs(expected).max(axis=0)
    assert_allclose(np.array(found[:-1]) / scale, expected / scale, rtol=0.0, atol=1e-12)
    assert np.abs(expected[:, 2 * N :]).max() > 1.0


@pytest.mark.parametrize(
    "compensation", [CompensationSpec(), CompensationSpec("reference", "estimate", "none", 0.05, 1e-5)]
)
def test_the_torque_control_of_a_recorded_run(run, tmp_path, compensation):
    compiled = Compiled(to_c(MODELS, ROBOT, replace(SPEC, compensation=compensation)), tmp_path)
    gains = TorqueGains.from_servo(MODELS, kp=SPEC.kp, ki=SPEC.ki)
    system = TorqueControl(MODELS, gains, joint_limits(ROBOT).effort, DT, compensation)
    order = {"desired_torque": "desired_torque", "estimated_torque": "estimated_torque", "position": "encoder"}
    order |= {"joint_estimate": "joint_estimate", "reference": "reference"}
    stage = alone(system, ([*order, "torque_terms"], ["command"]))
    compiled.call("init", state=True)
    commands = []
    for k in range(len(run["encoder"])):
        given = {name: run[source][k].copy() for name, source in order.items()} | {"torque_terms": np.zeros(6 * N)}
        if k == 300:
            given["estimated_torque"] += 1e4  # beyond the limits, for the integral to be held
        if k == 400:
            given["position"][1] = np.nan
        out = np.empty(N)
        sound = compiled.call("torque_control", *(given[name] for name in order), out, state=True)
        assert sound == (k != 400)
        commands.append((out, stage.tick(given)["command"]))
    found, expected = np.array(commands).swapaxes(0, 1)
    assert_allclose(found, expected, rtol=0.0, atol=1e-12)
    assert np.isnan(found[400]).all()
    assert np.nanmax(np.abs(found - run["encoder"])) > 1e-3


def in_drake(robot):
    """Drake's plant, its context, and the places of the robot's joints."""
    plant = make_plant(robot, 0.0)
    places = [plant.GetJointByName(name).velocity_start() for name in robot.joints]
    return plant, plant.CreateDefaultContext(), places


def test_inverse_dynamics_and_gravity_are_drakes(leg):
    rng = np.random.default_rng(3)
    plant, context, places = in_drake(ROBOT)
    for _ in range(50):
        q, v, a = rng.normal(0.0, 1.0, (3, N))
        state = np.zeros((3, N))
        state[:, places] = q, v, a
        plant.SetPositions(context, state[0])
        found = np.empty((2, N))
        leg.call("gravity", q, found[0])
        leg.call("inverse_dynamics", q, v, a, found[1])
        assert_allclose(found[0], -plant.CalcGravityGeneralizedForces(context)[places], rtol=0.0, atol=1e-12)
        plant.SetVelocities(context, state[1])
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        expected = plant.CalcInverseDynamics(context, state[2], forces)[places]
        assert_allclose(found[1], expected, rtol=1e-12, atol=1e-11)


def test_prismatic_joints_and_branches_are_drakes(tmp_path):
    """A cart on a rail with a slide and two arms, each joint about an axis of its own and turned."""
    urdf = tmp_path / "tree.urdf"
    joints = [
        ("rail", "prismatic", "base", "cart", "0.3 0.1 0.9"),
        ("left", "revolute", "cart", "arm", "0 0.6 0.8"),
        ("slide", "prismatic", "arm", "hand", "1 0 0"),
        ("right", "revolute", "cart", "other", "0.5 0.5 0.1"),
    ]
    links = "".join(
        f'<link name="{name}"><inertial><origin xyz="0.1 {0.02 * i} -0.05" rpy="0.1 {0.2 * i} 0.3"/>'
        f'<mass value="{1 + i}"/>'
        f'<inertia ixx="{0.1 + 0.01 * i}" iyy="0.12" izz="0.15" ixy="0.01" ixz="-0.02" iyz="0.005"/></inertial></link>'
        for i, name in enumerate(("cart", "arm", "hand", "other"))
    )
    rows = "".join(
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
        f'<origin xyz="0.2 -0.1 0.3" rpy="0.4 -0.2 0.7"/><limit effort="50" velocity="3" lower="-2" upper="2"/></joint>'
        for name, kind, parent, child, axis in joints
    )
    urdf.write_text(f'<robot name="tree"><link name="base"/>{links}{rows}</robot>')
    names = ", ".join(name for name, *_ in reversed(joints))
    (tmp_path / "tree.yaml").write_text(
        f"name: tree\nurdf: tree.urdf\nbase: base\nfixed_base: true\njoints: [{names}]\n"
    )
    robot = load_robot(tmp_path / "tree.yaml")
    drives = [ActuatorModel(name, Drive("current", 0.4)) for name in robot.joints]
    compiled = Compiled(to_c(drives, robot, CSpec(name="tree")), tmp_path)
    plant, context, places = in_drake(robot)
    rng = np.random.default_rng(0)
    for q, v, a in rng.normal(0.0, 1.0, (20, 3, 4)):
        state = np.zeros((3, 4))
        state[:, places] = q, v, a
        plant.SetPositions(context, state[0])
        plant.SetVelocities(context, state[1])
        found = np.empty(4)
        compiled.call("inverse_dynamics", q, v, a, found)
        mass = plant.CalcMassMatrix(context)
        expected = mass @ state[2] + plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context)
        assert_allclose(found, expected[places], rtol=1e-12, atol=1e-11)


def test_external_torques_of_a_recorded_run(leg, run):
    """The residual of the C file holds after its call, that of the system at the next tick."""
    observer = MomentumResidual(TorqueModel(ROBOT, base="fixed", angular_acceleration="zero"), SPEC.residual_gain, DT)
    stage = alone(observer, (["joint_state", "torque"], ["residual"]))
    leg.call("init", state=True)
    found, expected = [], []
    for k in range(500):
        state, torque = run["joint_state"][k].copy(), run["actuation"][k].copy()
        if k == 250:
            torque[0] = np.nan
        expected.append(stage.tick({"joint_state": state, "torque": torque})["residual"])
        found.append(np.empty(N))
        leg.call("external_torque", state[:N].copy(), state[N:].copy(), torque, found[-1], state=True)
    assert np.abs(expected).max() > 1.0
    assert_allclose(found[:-1], expected[1:], rtol=0.0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.key)
def test_every_effect_is_compensated_as_in_python(effect, tmp_path):
    rng = np.random.default_rng(sum(map(ord, effect.key)))
    models = []
    for number_, kind in enumerate(("position_servo", "current", "voltage")):
        lows = {p.name: max(p.lower, -3.0) for p in effect.parameters}
        highs = {p.name: max(lows[p.name], min(p.upper, 3.0)) for p in effect.parameters}
        values = {name: float(rng.uniform(low, highs[name])) for name, low in lows.items()}
        own = (EffectValue(effect.key, values), EffectValue("viscous", {"viscous": 2.0}))
        try:
            models.append(
                ActuatorModel(f"joint_{number_}", Drive(kind, 0.5), own[: 1 if effect.key == "viscous" else 2])
            )
        except ParamsError:
            continue  # an effect that this drive cannot have
    if not models:
        pytest.skip("no drive has it")
    compensator = Compensator(models, 0.01, 0.02)
    if compensator.interpreted:
        with pytest.raises(ParamsError, match="without compiled equation"):
            to_c(models)
        return
    spec = CSpec(name="one", compensation=CompensationSpec(smoothing=0.02))
    compiled = Compiled(to_c(models, None, spec), tmp_path)
    n = len(models)
    for _ in range(20):
        now = [
            rng.normal(0, 20, n), rng.normal(0, 3, n), rng.uniform(-1, 1, n),
            rng.normal(0, 2, n), rng.normal(0, 9, n), rng.uniform(0, 90, n),
        ]  # fmt: skip
        out = np.empty(n)
        compiled.call("effort", *now, out)
        tau, v, d, q, a, celsius = now
        assert_allclose(out, compensator.effort(tau, Motion(v, q, a, d, celsius)), rtol=1e-12, atol=1e-12)


def test_drive_effects_are_among_them():
    assert any(isinstance(effect, DriveEffect) for effect in EFFECTS)
    assert len(EFFECTS) > 25


def played(rng, start):
    """(command, position, fault) of each tick: a joint that follows, now and then what is lost, late or far off."""
    position, fault = start.copy(), 0.0
    yield start, np.full(N, np.nan), 0.0
    for k in range(3000):
        if k % 150 == 0:
            fault = rng.choice([0.0, 0.0, 1.0, 2.0])
            odd = rng.choice([np.nan, np.inf, 5.0], N), rng.random((2, N)) < rng.choice([0.0, 0.0, 0.1, 0.5])
        command = position + rng.normal(0.0, 2e-4, N)
        position = position + rng.normal(0.0, 3e-4, N)
        yield np.where(odd[1][0], odd[0], command), np.where(odd[1][1] & (k % 7 == 0), np.nan, position), fault


@pytest.mark.parametrize("seed", range(4))
def test_the_guard_is_that_of_python(tmp_path, seed):
    """Commands and modes over starts, holds, damps and returns; commands of servos are in the joints' ranges."""
    rng, limits = np.random.default_rng(seed), joint_limits(ROBOT)
    spec = GuardSpec(start_time=0.05, hold_time=0.03, recover_time=0.02, blend_time=0.03, rate_limit=4.0)
    compiled = Compiled(to_c(MODELS, ROBOT, replace(SPEC, guard=spec)), tmp_path)
    compiled.call("init", state=True)
    law = GuardLaw(N, DT, rated_guard(spec, list(MODELS.values()), limits.effort, limits.velocity))
    state, after, seen = law.initial(), law.initial(), set()
    for command, position, fault in played(rng, ROBOT.posture):
        sent = np.empty(N)
        mode = compiled.call("guard", command, position, fault, sent, state=True)
        within = np.where(np.isfinite(command), np.clip(command, limits.lower, limits.upper), command)
        law.step(state, within, position, fault, after)
        state, after = after, state
        assert mode == (state[3 * N] if state[3 * N + 4] else -1)
        assert_allclose(sent, state[:N], rtol=0.0, atol=1e-15)
        seen.add(mode)
    assert seen == {-1, 0, 1, 2, 3}


def test_a_drive_of_which_nothing_is_known_has_no_guard():
    drive = {"j": ActuatorModel("j", Drive("current", 0.1))}
    assert "_guard(" not in to_c(drive).header
    assert "_guard(" in to_c(drive, None, CSpec(guard=GuardSpec(offset_limit=2.0))).header


BENCH = r"""
#include "leg.h"
#include <stdio.h>
#include <time.h>
int main(void)
{
    static leg_state s;
    double q[LEG_JOINTS], v[LEG_JOINTS], tau[LEG_JOINTS], command[LEG_JOINTS], residual[LEG_JOINTS];
    double motion[3 * LEG_JOINTS], reference[3 * LEG_JOINTS] = { 0.0 };
    double best = 1e9, sum = 0.0;
    leg_init(&s);
    for (int round = 0; round < 20; round++) {
        clock_t begin = clock();
        for (int k = 0; k < 5000; k++) {
            for (int j = 0; j < LEG_JOINTS; j++) {
                q[j] = 0.3 * j + 1e-4 * k;
                v[j] = 0.1 * j;
            }
            leg_filter(&s, q, motion);
            leg_gravity(q, tau);
            leg_torque_control(&s, tau, tau, q, motion, reference, command);
            leg_external_torque(&s, q, v, tau, residual);
            sum += command[0] + residual[0];
        }
        double seconds = (double)(clock() - begin) / CLOCKS_PER_SEC / 5000.0 / LEG_JOINTS;
        best = seconds < best ? seconds : best;
    }
    printf("%.9f %g\n", 1e6 * best, sum);
    return 0;
}
"""


def test_a_tick_takes_less_than_a_microsecond_a_joint(tmp_path):
    """The best of 20 rounds: filter, gravity, torque control and external torques."""
    to_c(MODELS, ROBOT, SPEC).write(tmp_path)
    (tmp_path / "main.c").write_text(BENCH)
    subprocess.run(["cc", *FLAGS, "main.c", "leg.c", "-o", "main", "-lm"], cwd=tmp_path, check=True)
    done = subprocess.run(["./main"], cwd=tmp_path, check=True, capture_output=True, text=True)
    microseconds = float(done.stdout.split()[0])
    print(f"{microseconds:.3f} us a joint")
    assert microseconds < 1.0


def test_what_has_no_c_is_refused():
    for refused, said in (
        (lambda: to_c(MODELS, replace(ROBOT, fixed_base=False)), "expected a fixed base"),
        (lambda: CSpec(name="My Arm"), "name: expected an identifier of C"),
        (lambda: CSpec(kp=-1.0), "kp: expected a number >= 0"),
        (lambda: c_function(looping), "has no counterpart in C"),
    ):
        with pytest.raises(ParamsError, match=said):
            refused()
    assert [number(x) for x in (1.0, 1e-7, -3.25, np.inf)] == ["1.0", "1e-07", "-3.25", "HUGE_VAL"]


def looping(x):
    for _ in range(3):
        x = x + 1.0
    return x
