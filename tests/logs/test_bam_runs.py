"""BAM recordings: numbers checked against the raw files and against physics, loaded as runs; the command `import`."""

import json

import numpy as np
import pandas as pd
import pytest
import typer
from numpy.testing import assert_allclose
from typer.testing import CliRunner

from drake_tc.cli.log_commands import import_logs
from drake_tc.cli.options import with_flat_options
from drake_tc.errors import LogError
from drake_tc.logs.files.bam_runs import applied_duty, convert
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.prepare import load_run, load_runs
from drake_tc.logs.rig import load_rig


def by_folder(rigs, name="rig.yaml"):
    return {rig.parent.name: rig for rig in rigs if rig.name == name}


def test_bam_voltage_follows_the_firmware_law(data, tmp_path):
    rigs = convert(data / "bam-xl330-pendulum", tmp_path)
    folders = by_folder(rigs)
    assert sorted(folders) == ["xl330_kp100", "xl330_kp200", "xl330_kp800"]
    rig = load_rig(folders["xl330_kp100"])
    assert rig.drive["servo"] == "voltage" and rig.load["servo"] == Pendulum(0.49, 0.1)
    assert load_rig(by_folder(rigs, "rig_servo.yaml")["xl330_kp100"]).drive["servo"] == "position_servo"
    run = load_run(folders["xl330_kp100"].parent / "sin_sin.parquet", rig)
    error = run.columns["servo/position_command"] - run.columns["servo/position"]
    law = 100 * 4096 / (2 * np.pi) / (256 * 885) * error * 7.3
    # supply read in 0.1 V steps, duty of the last firmware cycle: the law holds to about 5 % of its size
    assert_allclose(run.columns["servo/voltage"], law, rtol=0, atol=0.15 * np.abs(law).max())
    assert np.corrcoef(run.columns["servo/voltage"], law)[0, 1] > 0.99
    dropped = load_run(folders["xl330_kp100"].parent / "lift_and_drop.parquet", rig)
    assert any("drive switched off" in note for note in dropped.notes)
    assert_allclose(dropped.time[dropped.segment >= 0].max(), 2.0, atol=0.05)  # torque goes off after 2 s


def test_bam_feetech_has_no_load_register_and_one_rig(data, tmp_path):
    (rig_file,) = convert(data / "bam-sts3250-pendulum", tmp_path)
    rig = load_rig(rig_file)
    assert rig.drive["servo"] == "position_servo" and rig.load["servo"] == Pendulum(1.13, 0.12)
    assert len(load_runs(sorted(rig_file.parent.glob("*.parquet")), rig)) == 4
    assert "servo/voltage" not in pd.read_parquet(rig_file.parent / "sin_sin.parquet")


def pendulum_run(**changes):
    """A run of a pendulum at rest, in the form of the data set."""
    entry = {"position": 0.1, "goal_position": 0.1, "speed": 0.0, "load": 3, "torque_enable": True}
    entries = [entry | {"timestamp": 0.01 * i, "position": 0.1 + 1e-3 * i, "load": 3 + i} for i in range(50)]
    run = {"mass": 0.5, "length": 0.2, "kp": 8, "vin": 7.4, "motor": "m", "trajectory": "a", "entries": entries}
    return run | changes


def test_bam_arms_have_mass_and_masses_may_differ_by_run(tmp_path):
    """Of a point mass and a uniform rod: weight and inertia by hand."""
    for name, mass in (("light", 0.0), ("heavy", 0.5)):
        run = pendulum_run(mass=mass, arm_mass=0.12, trajectory=name)
        (tmp_path / f"{name}.json").write_text(json.dumps(run))
    voltage, _servo = convert(tmp_path, tmp_path / "out")
    rig = load_rig(voltage)
    for run in (load_run(path, rig) for path in voltage.parent.glob("*.parquet")):
        mass = {"light": 0.0, "heavy": 0.5}[run.name]
        pendulum = rig.load["servo"].in_run(run)
        assert_allclose(pendulum.mass * pendulum.length, 0.2 * mass + 0.1 * 0.12, rtol=1e-12)
        assert_allclose(pendulum.inertia, 0.2**2 * mass + 0.12 * 0.2**2 / 3.0, rtol=1e-12)
    # no register of the supply was read: the file's own voltage is taken
    volts = pd.read_parquet(voltage.parent / "light.parquet")["servo/voltage"]
    assert_allclose(volts, 7.4 * (3 + np.arange(50)) / 885.0, rtol=1e-12)


def test_what_bam_runs_have_beside_is_named_in_their_rig_files(tmp_path):
    entries = [each | {"current": 0.1} for each in pendulum_run()["entries"]]
    (tmp_path / "a.json").write_text(json.dumps(pendulum_run(entries=entries, friction_plate="steel")))
    for rig in convert(tmp_path, tmp_path / "out"):
        assert rig.read_text().splitlines()[0].endswith("; not used: current, friction_plate")


def test_bam_runs_without_any_mass_have_an_unknown_load(tmp_path):
    (tmp_path / "free.json").write_text(json.dumps(pendulum_run(mass=0.0)))
    (tmp_path / "loaded.json").write_text(json.dumps(pendulum_run()))
    rigs = {rig.parent.name: load_rig(rig) for rig in convert(tmp_path, tmp_path / "out")}
    assert rigs["m_kp8_no_load"].load["servo"] == "unknown" and rigs["m_kp8"].load["servo"] == Pendulum(0.5, 0.2)
    for key, value in (("mass", -1.0), ("arm_mass", "x"), ("length", 0.0)):
        (tmp_path / "odd.json").write_text(json.dumps(pendulum_run(**{key: value})))
        with pytest.raises(LogError, match=rf"odd\.json: {key}: expected a"):
            convert(tmp_path, tmp_path / "out")


def test_the_duty_register_is_a_twos_complement():
    assert_allclose(applied_duty(np.array([0, 885, 65536 - 885])), [0, 1, -1], rtol=0)


def bam_run(tmp_path, **changes):
    entries = [{"timestamp": 0.01 * k, "position": 0.1 * k, "goal_position": 0.1 * k + 0.05} for k in range(30)]
    run = {"mass": 1.0, "length": 0.1, "kp": 8, "motor": "other", "entries": entries} | changes
    (tmp_path / "run.json").write_text(json.dumps(run))
    return convert(tmp_path, tmp_path / "out")


def test_bam_of_a_motor_that_reports_position_alone(tmp_path):
    (rig_file,) = bam_run(tmp_path)
    (run,) = load_runs(sorted(rig_file.parent.glob("*.parquet")), load_rig(rig_file))
    assert_allclose(run.columns["servo/position"], 0.1 * np.arange(30))
    assert "servo/temperature" not in run.columns


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ([{"timestamp": 0.0, "position": 0.0}], "entries: missing goal_position; present: position, timestamp"),
        ([{"timestamp": 0.0, "position": 0.0}, {"timestamp": 0.1}], "entries: expected the same keys with numbers"),
        ([{"timestamp": "now", "position": 0.0}], "entries: expected the same keys with numbers"),
    ],
)
def test_bam_entries_that_are_odd_are_refused(tmp_path, entries, message):
    with pytest.raises(LogError, match=message):
        bam_run(tmp_path, entries=entries)


def command() -> typer.Typer:
    app = typer.Typer()
    app.command("import")(with_flat_options(import_logs))
    return app


@pytest.fixture
def one_run(tmp_path):
    """A folder with one run, and the rig files that `import` makes of it."""
    source = tmp_path / "source"
    source.mkdir()
    (source / "run.json").write_text(json.dumps(pendulum_run()))
    folder = tmp_path / "out" / "m_kp8"
    return source, [str(folder / "rig.yaml"), str(folder / "rig_servo.yaml")]


def test_command_prints_the_rig_files(one_run, tmp_path):
    source, rigs = one_run
    result = CliRunner().invoke(command(), ["bam", str(source), "--out", str(tmp_path / "out")])
    assert result.exit_code == 0
    assert result.stdout.splitlines() == rigs


def test_command_prints_json(one_run, tmp_path):
    source, rigs = one_run
    arguments = ["bam", str(source), "--out", str(tmp_path / "out"), "--json", "--seed", "0"]
    result = CliRunner().invoke(command(), arguments)
    assert json.loads(result.stdout) == {"name": "import", "rigs": rigs}


@pytest.mark.parametrize("arguments", [["bam", "nowhere"], ["kuka", "."]])
def test_command_refuses_and_leaves_nothing(tmp_path, arguments):
    result = CliRunner().invoke(command(), [*arguments, "--out", str(tmp_path)])
    assert isinstance(result.exception, LogError)
    assert result.stdout == "" and not list(tmp_path.iterdir())


@pytest.mark.parametrize("rig_name", ["rig_1", "rig_2", "rig_3"])
def test_practice_rigs_load_with_no_note(data, rig_name):
    folder = data / "bench-practice" / rig_name
    rig = load_rig(folder / "rig.yaml")
    runs = load_runs(sorted(folder.glob("run_*")), rig)
    assert [run.name for run in runs] == ["run_multisine", "run_sine", "run_static"]
    for run in runs:
        assert run.period == 1e-3 and len(run) == 29950
        assert run.notes == ()  # a pulse of 88 N m in one of them answers a pulse of the voltage
    assert rig.known("joint", "rotor_inertia") > 0.3
