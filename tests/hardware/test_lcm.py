"""Both ends of LCM: messages that Drake's own type reads, a robot in another process, the stop message, the command."""

import json
import threading
import time

import numpy as np
import pytest
from drake import lcmt_drake_signal
from numpy.testing import assert_array_equal
from pydrake.lcm import DrakeLcm, Subscriber

from drake_tc.cli.main import run
from drake_tc.errors import ParamsError
from drake_tc.hardware.lcm_link import COMMAND, STATUS, LcmLink, LcmRobot, SignalCodec, send_stop
from tests.benchmarks.real_time import URL, measured, permitted_priority

BUS = "udpm://239.255.76.69:7669?ttl=0"
SIZES = {"position": 2, "imu": 6}


def test_drakes_own_type_reads_and_writes_the_messages():
    codec = SignalCodec(SIZES)
    values = {"position": np.array([0.5, -np.pi]), "imu": np.array([0.0, np.nan, np.inf, 1e-300, -0.0, 9.81])}
    message = lcmt_drake_signal.decode(codec.encode(values, 42))
    assert (message.dim, message.timestamp) == (8, 42)
    assert message.coord == ["position[0]", "position[1]", *(f"imu[{i}]" for i in range(6))]
    assert_array_equal(message.val, np.concatenate(list(values.values())))
    found = codec.decode(message.encode())
    for name in SIZES:
        assert_array_equal(found[name], values[name])


@pytest.mark.parametrize("change", ["dim", "coord", "short", "other"])
def test_another_message_is_refused(change):
    codec = SignalCodec(SIZES)
    message = lcmt_drake_signal.decode(codec.encode({name: np.zeros(size) for name, size in SIZES.items()}, 0))
    if change == "dim":
        message.dim, message.val, message.coord = 7, message.val[:7], message.coord[:7]
    if change == "coord":
        message.coord[0] = "position[7]"
    data = message.encode()
    assert codec.decode({"short": data[:-1], "other": b"\0" * len(data)}.get(change, data)) is None


def test_both_ends_meet_on_the_bus():
    link, robot = LcmLink(SIZES, 2, BUS), LcmRobot(SIZES, 2, BUS)
    foreign = Subscriber(DrakeLcm(BUS), COMMAND, lcmt_drake_signal)
    assert link.read() is None
    readings = {name: np.arange(size, dtype=float) for name, size in SIZES.items()}
    robot.send(readings)
    found = _soon(link.read)
    for name in SIZES:
        assert_array_equal(found[name], readings[name])
    link.write({"command": np.array([1.0, 2.0]), "mode": np.array([1.0])})
    assert_array_equal(_soon(robot.receive)["command"], [1.0, 2.0])
    assert foreign.count == 0  # its bus was never asked
    DrakeLcm(BUS).Publish(STATUS, b"noise")
    time.sleep(0.01)
    assert link.read() is None
    assert link.refused == 1
    send_stop(BUS)
    _soon(lambda: link.read() is None and (link.stop_requested() or None))


def _soon(look):
    for _ in range(2000):
        found = look()
        if found is not None:
            return found
        time.sleep(1e-3)
    raise AssertionError("nothing came")


def test_a_bus_of_another_kind_is_refused():
    with pytest.raises(ParamsError, match=r"LCM: expected a URL that begins with udpm://, .* got 'nonsense://'"):
        LcmLink(SIZES, 2, "nonsense://")


def test_a_second_at_1_khz_against_a_robot_in_another_process():
    """What a busy machine leaves: the run goes on to its end, nothing fails, most ticks are in time."""
    report = measured(1.0, permitted_priority())
    assert report.ended == "duration"
    assert report.counts.link_errors == report.counts.controller_errors == report.counts.malformed == 0
    assert 1.0 <= report.seconds <= 1.5
    assert report.counts.ticks + report.counts.skipped >= 1_100
    assert report.miss_share < 0.5
    assert np.all(np.isfinite(report.work))


def test_the_command_runs_a_controller_and_a_message_stops_it(capsys):
    """The stop message ends `drake-tc run` without a duration; `--stop` sends it."""
    robot = "drake_tc.diagrams.hardware_loop:link"
    arguments = ["run", "drake_tc.diagrams.hardware_loop:controller", "--robot", robot, "--duration", "0.3"]
    assert run([*arguments, "--stop-time", "0.05", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["ended"], told["counts"]["controller_errors"]) == ("duration", 0)
    assert run(["run", "hrp2_leg", "--robot", robot, "--duration", "0.1", "--stop-time", "0.05", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["counts"]["controller_errors"] == 0
    leg = ["run", "drake_tc.diagrams.hardware_loop:controller", "--robot", f"lcm={BUS}"]
    assert run([*leg, "--patience", "0.05"]) == 3
    assert "no sound readings within 0.05 s" in capsys.readouterr().err
    done = threading.Event()

    def stop():
        """Again and again: one that comes before the controller listens is lost."""
        while not done.wait(0.3):
            run(["run", leg[1], "--robot", f"lcm={BUS}", "--stop"])

    thread = threading.Thread(target=stop)
    thread.start()
    try:
        assert run([*leg, "--patience", "20", "--json"]) == 0
    finally:
        done.set()
        thread.join()
    assert json.loads(capsys.readouterr().out)["ended"] == "stop message"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["drake_tc.models:MODELS"], "CONTROLLER: drake_tc.models:MODELS: cannot be loaded"),
        (["drake_tc.diagrams.hardware_loop:robot"], "expected a function that returns a controller"),
        (["drake_tc.diagrams.hardware_loop:controller", "--robot", "json:loads"], "--robot"),
        (["drake_tc.diagrams.hardware_loop:controller", "--robot", "drake_tc.types:GRAVITY"], "none with read()"),
        (["drake_tc.diagrams.hardware_loop:controller", "--rate-limit", "-1"], "guard.rate_limit: expected"),
        (["drake_tc.diagrams.hardware_loop:controller", "--duration", "nan"], "--duration"),
        (["drake_tc.diagrams.hardware_loop:controller", "--scenario-name", "swing"], "--scenario"),
        (["hrp2_legs"], "no diagram 'hrp2_legs'"),
        (["sea_joint"], "expected the diagram of a torque loop or of a whole-body loop"),
        (["humanoid_tsid"], "guard: expected limits"),
    ],
)
def test_what_cannot_run_is_told_in_one_line(arguments, message, capsys):
    assert run(["run", *arguments]) == 2
    told = capsys.readouterr().err
    assert message in told
    assert len(told.strip().splitlines()) == 1
    assert URL != BUS
