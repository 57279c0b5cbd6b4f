"""The real-time loop on a clock of its own: the commands of the simulated loop, faults, arming and stops."""

import signal
import threading
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import load_models
from drake_tc.control.guard import GuardMode, GuardSpec
from drake_tc.control.trajectories import knot_trajectory
from drake_tc.diagrams import hardware_loop
from drake_tc.diagrams.hardware_loop import ROBOT, SPEC, SWING, TIMES, robot
from drake_tc.errors import ParamsError
from drake_tc.hardware.link import CallbackLink
from drake_tc.hardware.loop import RealTimeLoop, RealTimeSpec
from drake_tc.hardware.simulated_robot import SimulatedRobot, serve
from drake_tc.hardware.stepper import ControllerStepper
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.torque.wiring import add_torque_loop, torque_controller
from drake_tc.loops.whole_body.wiring import whole_body_controller
from drake_tc.robot.robot import load_robot
from drake_tc.tsid.configuration import load_law
from tests.robot_files import joint_tag, link_tag, urdf, write_robot

DT = 1e-3
QUICK = RealTimeSpec(arm_time=0.0, stop_time=0.05, guard=GuardSpec(start_time=0.0))


@cache
def controller():
    """One for all runs: what changes is in their Contexts."""
    return hardware_loop.controller()


class Steps:
    """A clock whose time goes on when somebody waits; it can be made to jump."""

    def __init__(self, jumps=None):
        self.time, self.jumps = 0.0, dict(jumps or {})

    def now(self):
        return self.time

    def wait_until(self, when):
        self.time = max(self.time, when)

    def work(self, tick):
        self.time += self.jumps.get(tick, 2e-4)


class Rig:
    """A simulated leg behind two functions, with faults at ticks; records what comes in and goes out."""

    def __init__(self, clock, faults=None):
        self.robot, self.clock, self.faults = robot(), clock, faults or {}
        self.readings, self.commands, self.modes, self.ticks = [], [], [], 0
        self.link = CallbackLink(self.read, self.write)

    def read(self):
        self.ticks += 1
        found = self.robot.read()
        self.readings.append(found)
        fault = self.faults.get(self.ticks)
        return found if fault is None else fault(dict(found))

    def write(self, command):
        self.clock.work(len(self.commands))
        self.commands.append(command["command"])
        self.modes.append(int(command["mode"][0]))
        self.robot.advance(command["command"])


def run(duration=0.2, faults=None, jumps=None, spec=QUICK, made=controller):
    clock = Steps(jumps)
    rig = Rig(clock, faults)
    loop = RealTimeLoop(made(), rig.link, spec, clock)
    report = loop.run(duration)
    commands = np.array(rig.commands)
    assert np.all(np.isfinite(commands))
    assert np.abs(np.diff(commands, axis=0)).max() <= 20.0 * DT * (1 + 1e-9)
    return report, rig, commands


def raising(_):
    raise OSError("cable")


def test_controller_and_simulated_robot_are_the_torque_loop():
    """Where the sensors feel the command of their own tick, as in one Diagram, all numbers are the same."""
    described = load_robot(ROBOT)
    models = load_models(described.actuators)
    builder = DiagramBuilder()
    plant = add_robot_plant(builder, described, DT)
    for joint, position in zip(described.joints, described.posture, strict=True):
        plant.GetJointByName(joint).set_default_angle(position)
    motion = knot_trajectory(TIMES, described.posture + SWING[[0, 1, 0, 1]])
    loop = add_torque_loop(builder, plant, described, models, motion, SPEC)
    log = loop.add_log(builder, "encoder", "imu", "force_torque", "command")
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(1.3)
    signals = log.recorded(simulator.get_context())[1]
    leg, stepper = robot(), ControllerStepper(controller(), DT)
    found = []
    for _ in range(1301):
        leg.apply(stepper.evaluate(leg.read())["command"])
        readings = leg.read()
        command = stepper.tick(readings)["command"]
        found.append(np.concatenate((*readings.values(), command)))
        leg.advance(command)
    assert_array_equal(np.array(found), np.hstack(list(signals.values())))
    assert np.ptp(signals["encoder"], axis=0).max() > 0.1


def test_an_object_with_two_functions_is_a_driver():
    """It never asks for a stop, and nothing has to be closed: neither is told as an error."""

    class Driver:
        def __init__(self):
            self.robot = robot()

        def read(self):
            return self.robot.read()

        def write(self, command):
            self.robot.advance(command["command"])

    report = RealTimeLoop(controller(), Driver(), QUICK, Steps()).run(0.05)
    assert report.ended == "duration"
    assert report.last_error == ""
    with pytest.raises(ParamsError, match="duration: expected a time >= 0"):
        RealTimeLoop(controller(), Driver(), QUICK, Steps()).run(-1.0)


def test_the_last_guard_leaves_a_sound_command_as_it_is():
    """In the normal mode, commands are those that the controller alone has for the same readings."""
    report, rig, commands = run(0.9)
    assert (report.ended, report.counts.missed, report.counts.held) == ("duration", 0, report.counts.ticks - 900)
    stepper = ControllerStepper(controller(), DT)
    alone = np.array([stepper.tick(readings)["command"] for readings in rig.readings[1:901]])
    normal = np.array(rig.modes[:900]) == GuardMode.NORMAL
    assert normal.mean() > 0.9
    assert_array_equal(commands[:900][normal], alone[normal])


MALFORMED = (
    lambda readings: {name: value for name, value in readings.items() if name != "position"},
    lambda readings: readings | {"position": np.zeros(3)},
    lambda readings: readings | {"imu": "broken"},
)


@pytest.mark.parametrize(
    ("faults", "count"),
    [
        ((lambda readings: None,), "missing"),
        (MALFORMED, "malformed"),
        ((lambda readings: readings | {"position": np.full(6, np.nan)},), None),
        ((lambda readings: readings | {"position": np.full(6, np.inf)},), None),
        ((raising,), "link_errors"),
    ],
)
def test_what_goes_wrong_is_counted_held_and_left_again(faults, count):
    """Faults in turn from the 100th to the 139th tick."""
    report, rig, _ = run(0.5, {tick: faults[tick % len(faults)] for tick in range(100, 140)})
    counts = report.counts
    if count is not None:
        assert getattr(counts, count) >= 34
    assert counts.held > 50 + 34  # of the stop, and of the fault
    modes = np.array(rig.modes)
    assert (modes[108:139] >= GuardMode.HOLD).all()
    assert (modes[380:499] < GuardMode.HOLD).all()
    if faults == (raising,):
        assert report.last_error == "OSError: cable"


def test_two_readings_that_are_late_are_bridged():
    report, rig, _ = run(0.2, dict.fromkeys((100, 101), lambda readings: None))
    assert (report.counts.late, report.counts.missing) == (2, 0)
    assert (np.array(rig.modes[:199]) < GuardMode.HOLD).all()


def test_a_driver_may_reuse_its_arrays():
    """Readings that are changed in place give the commands of readings of their own, late ones too."""
    buffers = {}

    def reuse(readings):
        for name, value in readings.items():
            buffers.setdefault(name, value.copy())[:] = value
        return buffers

    late = dict.fromkeys((100, 101), lambda readings: None)
    found = [run(0.2, late | dict.fromkeys(set(range(1, 260)) - set(late), each))[2] for each in (reuse, dict)]
    assert_array_equal(*found)


class Failing(LeafSystem):
    """A stage of one's own that fails from a time on, in one of three ways."""

    def __init__(self, way):
        super().__init__()
        self._way = way
        self.DeclareVectorInputPort("desired_torque", 6)
        self.DeclareVectorInputPort("position", 6)
        self.DeclareVectorOutputPort("command", 6, self._write)

    def _write(self, context, vector):
        vector.SetFromVector(self.GetInputPort("position").Eval(context))
        if context.get_time() > 0.1:
            if self._way == "nan":
                vector.SetFromVector(np.full(6, np.nan))
            else:
                raise {"exception": ValueError, "exit": SystemExit}[self._way]("own stage")


@pytest.mark.parametrize("way", ["nan", "exception", "exit"])
def test_a_controller_that_fails_is_held_and_damped(way):
    described = load_robot(ROBOT)

    def failing():
        return torque_controller(described, load_models(described.actuators), stages={"torque_control": Failing(way)})

    report, rig, _ = run(0.4, made=failing)
    assert report.counts.controller_errors >= (0 if way == "nan" else 290)
    told = "the controller's command is not finite; no signal between readings and command is"
    assert (told if way == "nan" else "own stage") in report.last_error
    assert way != "nan" or report.flags["command/not_finite"] >= 290
    assert rig.modes[350] == GuardMode.DAMP


def test_deadlines_that_are_missed_are_counted_and_a_long_gap_is_held():
    report, rig, _ = run(0.3, jumps={50: 2.5e-3, 100: 9.5e-3})
    assert (report.counts.missed, report.counts.skipped) == (2, 2 + 9)
    modes = np.array(rig.modes)
    assert modes[51] < GuardMode.HOLD
    assert modes[101] == GuardMode.HOLD
    assert (modes[250:280] < GuardMode.HOLD).all()


def timed(period, jitter):
    """Late ticks and all ticks of a second, of a robot that sends a reading every `period`, give or take `jitter`."""
    clock, leg, rng = Steps(), robot(), np.random.default_rng(0)
    arrivals = iter(np.arange(100_000) * period + rng.uniform(-jitter, jitter, 100_000))
    waiting = [next(arrivals)]

    def read():
        new = False
        while waiting[0] <= clock.time:
            new, waiting[0] = True, next(arrivals)
        return leg.read() if new else None

    def write(command):
        leg.advance(command["command"])

    counts = RealTimeLoop(controller(), CallbackLink(read, write), QUICK, clock).run(1.0).counts
    return counts.late, counts.ticks


def test_ticks_follow_readings_that_come_in_at_the_same_instants():
    """Where readings arrive with the ticks, give or take 20 us, every second tick would be late."""
    late, ticks = timed(DT, 2e-5)
    assert late < 0.02 * ticks
    late, ticks = timed(2.0 * DT, 0.0)  # a slower robot does not slow the controller
    assert 0.4 * ticks < late < 0.6 * ticks
    assert ticks >= 1045


def test_no_command_goes_out_before_readings_are_sound_or_in_a_dry_run():
    outside = {tick: (lambda readings: readings | {"position": np.full(6, 9.0)}) for tick in range(1, 400)}
    spec = RealTimeSpec(arm_time=0.05, patience=0.3, guard=QUICK.guard)
    report, rig, _ = _silent(outside, spec)
    assert report.ended == "no readings"
    assert not rig.commands
    report, rig, _ = _silent({}, RealTimeSpec(arm_time=0.05, stop_time=0.0, dry=True))
    assert not rig.commands
    assert report.counts.ticks == 201


def _silent(faults, spec):
    clock = Steps()
    rig = Rig(clock, faults)
    return RealTimeLoop(controller(), rig.link, spec, clock).run(0.2), rig, None


def test_a_signal_a_message_and_another_thread_stop_it():
    """Damped within the rates of the guard, and then silent."""
    for ending in ("signal", "stop message", "stopped"):
        clock = Steps()
        rig = Rig(clock)
        loop = RealTimeLoop(controller(), rig.link, QUICK, clock)

        def end(readings, ending=ending, rig=rig, loop=loop):
            if ending == "signal":
                signal.raise_signal(signal.SIGTERM)
            elif ending == "stopped":
                thread = threading.Thread(target=loop.stop)
                thread.start()
                thread.join()
            else:
                rig.link.stop_requested = lambda: True
            return readings

        rig.faults[100] = end
        before = signal.getsignal(signal.SIGTERM)
        report = loop.run(10.0)
        assert signal.getsignal(signal.SIGTERM) is before
        assert report.ended == ending
        assert 98 + 50 <= report.counts.ticks <= 102 + 50
        assert rig.modes[-1] == GuardMode.HOLD
        assert np.all(np.isfinite(rig.commands))


def test_torques_need_limits_of_their_own():
    law = load_law(ROBOT.parent / "hrp2_like_tsid.yaml")
    with pytest.raises(ParamsError, match="guard: expected limits"):
        RealTimeLoop(whole_body_controller(law), CallbackLink(dict, lambda command: None))
    with pytest.raises(ParamsError, match="guard: expected limits"):  # of rates alone, torques would have none
        RealTimeLoop(
            whole_body_controller(law),
            CallbackLink(dict, lambda command: None),
            RealTimeSpec(guard=GuardSpec(rate_limit=5.0)),
        )
    with pytest.raises(ParamsError, match="max_age: expected a number >= 0"):
        RealTimeSpec(max_age=-1.0)


def test_a_simulated_robot_may_slide(tmp_path):
    text = urdf(
        link_tag("car", (0, 0, 0), 4.0, (0.1, 0.1, 0.1)),
        joint_tag("x", "base", "car", axis=(1, 0, 0), kind="prismatic"),
    )
    described = load_robot(write_robot(tmp_path, text, ["x"], posture={"x": 0.3}))
    model = ActuatorModel(
        "x", Drive("position_servo", 1e-4), (EffectValue("rotor_inertia", {"rotor_inertia": 1.0}),), "prismatic"
    )
    rail = SimulatedRobot(described, [model])
    assert abs(rail.read()["position"][0] - 0.3) < 1e-3
    for _ in range(60):  # 1e4 N/m pull 5 kg: x(t) = 0.304 - 0.004 cos(45 t)
        rail.advance(np.array([0.304]))
    expected = 0.304 - 0.004 * np.cos(np.sqrt(1e4 / 5.0) * 0.06)
    assert abs(rail.read()["position"][0] - expected) < 2e-4


def test_a_simulated_robot_without_commands_is_switched_off_where_its_drives_are_no_servos(tmp_path):
    """A posture is no torque: 2 rad are not 2 N m."""
    text = urdf(link_tag("wheel", (0, 0, 0), 1.0, (0.1, 0.1, 0.1)), joint_tag("x", "base", "wheel", axis=(0, 0, 1)))
    described = load_robot(write_robot(tmp_path, text, ["x"], posture={"x": 2.0}))
    wheel = SimulatedRobot(described, [ActuatorModel("x", Drive("torque", 1.0), ())])
    served = serve(wheel, "memq://", 0.15)
    assert served.commands == 0
    assert abs(wheel.read()["position"][0] - 2.0) < 1e-3


@pytest.mark.parametrize("work", [4e-4, 2.5e-3, 2.05e-2])
def test_a_controller_that_is_too_slow_is_stopped_in_the_same_time(work):
    """Hold and damping last as long by the clock, whatever a tick takes."""
    spec = RealTimeSpec(arm_time=0.0, stop_time=0.3, guard=GuardSpec(start_time=0.0))
    report, rig, _ = run(0.0, jumps=dict.fromkeys(range(2000), work), spec=spec)
    assert abs(report.seconds - spec.stop_time) <= work + DT
    assert rig.modes[-1] == GuardMode.DAMP


def test_a_driver_that_takes_long_does_not_lengthen_the_patience():
    clock = Steps()

    def read():
        clock.time += 0.05

    spec = RealTimeSpec(patience=0.5, guard=QUICK.guard)
    report = RealTimeLoop(controller(), CallbackLink(read, lambda command: None), spec, clock).run(0.2)
    assert report.ended == "no readings"
    assert report.seconds <= 0.6


def test_readings_age_by_the_clock():
    """Ticks of five periods each: a reading of one tick before, 5 ms old, stands in, one of two does not."""
    jumps = dict.fromkeys(range(50, 70), 4.5e-3)
    faults = dict.fromkeys(range(55, 57), lambda readings: None)
    report, _, _ = run(0.2, faults, jumps)
    assert (report.counts.late, report.counts.missing) == (1, 1)
