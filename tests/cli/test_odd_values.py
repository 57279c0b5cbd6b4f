"""Values that are out of range, names that no file should have: one printable line that names the file, or a result."""

import json

import pandas as pd
import pytest
import yaml

SCENARIOS = {
    "parent is a list": ("sea_joint", "{b: {}, a: {extends: [b]}}", "a.extends: expected the name of a scenario"),
    "latency": ("hrp2_leg", "{sensors: {encoder: {latency: 1e308}}}", "latency"),
    "window": ("hrp2_leg", "{filters: {window: 9223372036854775808}}", "window"),
    "delay": ("sea_joint", "{delay: 2147483648}", "delay"),
    "inertia": ("sea_joint", "{link: {inertia: -1}}", "inertia"),
    "duration": ("sea_joint", "{duration: -1}", "duration"),
    "not a number": ("sea_joint", "{duration: .nan}", "duration"),
    "a key of control characters": ("sea_joint", '{"a\\eb": 1}', "unknown key 'a\\x1bb'"),
    "a surrogate": ("sea_joint", '{joint: "\\ud800"}', "not valid YAML"),
    "markup": ("sea_joint", "{joint: '[/x]'}", "[/x]"),
    "a tag": ("sea_joint", "{duration: !!float abc}", "the tag '!!float' is not read"),
    "deep": ("sea_joint", "{a: " * 90 + "1" + "}" * 90, "at most 50 levels"),
}


@pytest.mark.parametrize("case", SCENARIOS)
def test_a_scenario_with_odd_fields(invoke, tmp_path, case):
    diagram, text, says = SCENARIOS[case]
    if case == "parent is a list":
        path = tmp_path / "s.yaml"
        path.write_text(text)
        call = ["simulate", diagram, "--scenario-file", path, "--scenario-name", "a", "--duration", 0.02]
    else:
        short = [] if case in ("duration", "not a number") else ["--duration", 0.02]
        call = ["simulate", diagram, "--scenario-text", text, *short]
    line = invoke(*call, "--json").refusal()
    assert says in line and line.isprintable() and len(line) < 1300


def test_a_duration_that_is_shorter_than_a_delay_is_simulated(invoke):
    outcome = invoke("simulate", "sea_joint", "--scenario-text", "{delay: 0.015}", "--duration", 0.01, "--json")
    assert outcome.code == 0 and json.loads(outcome.out)["duration"] == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"frames": {"right_palm": {"link": None}}}, "right_palm"),
        ({"period": 1e308}, "period"),
        ({"contacts": {"right_sole": {"link": "nowhere"}}}, "nowhere"),
        ({"tasks": {"com": {"kind": 3}}}, "kind"),
    ],
)
def test_a_controller_with_odd_fields(invoke, tmp_path, changes, says):
    text = yaml.safe_dump({"changes": changes})
    line = invoke("graph", "humanoid_tsid", "--format", "json", "--scenario-file", _scenario(tmp_path, text)).refusal()
    assert says in line and line.isprintable()


def _scenario(folder, text):
    from pathlib import Path

    models = Path(__file__).resolve().parents[2] / "models"
    fields = {"controller": str(models / "hrp2_like" / "hrp2_like_tsid.yaml"), "duration": 0.01, **yaml.safe_load(text)}
    path = folder / "s.yaml"
    path.write_text(yaml.safe_dump({"s": fields}))
    return path


def test_joints_with_markup_and_control_characters_in_a_model_file(invoke, tmp_path):
    joint = {"drive": {"kind": "current", "gain": 0.1}, "effects": [{"effect": "viscous", "viscous": 1.0}]}
    model = {"joints": {"[/x]": joint}}
    path = tmp_path / "model.yaml"
    path.write_text(yaml.safe_dump(model))
    outcome = invoke("export", path, "--to", "mjcf")
    assert outcome.code == 0 and "[/x]" in outcome.out
    model["joints"]["a\x1bb"] = model["joints"].pop("[/x]")
    path.write_text(yaml.safe_dump(model))
    line = invoke("export", path, "--to", "mjcf").refusal()
    assert "expected names of printable characters; got 'a\\x1bb'" in line


def test_an_argument_with_control_characters_is_told_in_printable_ones(invoke):
    line = invoke("simulate", "sea_joint", "--scenario-name", "a\x1b[31mb\u202e").refusal()
    assert line.isprintable()


def test_importers_refuse_odd_entries(invoke, tmp_path):
    source = tmp_path / "set"
    source.mkdir()
    run = {"mass": 0.5, "length": 0.1, "kp": 100, "motor": "xl330", "trajectory": "../../lift"}
    entries = [{"timestamp": 0.01 * i, "position": 0.1, "goal_position": 0.2} for i in range(30)]
    for changes, says in (
        ({"mass": "heavy"}, "mass: expected a number, got 'heavy'"),
        ({"kp": None}, "kp: expected a number, got null"),
        ({"entries": []}, "entries: expected a list of mappings"),
        ({"entries": [*entries, {"timestamp": "soon"}]}, "entry 31 has 'soon' as 'timestamp'"),
        ({"entries": [*entries, {"timestamp": 1.0}]}, "entry 31 has nothing as 'position'"),
    ):
        (source / "run.json").write_text(json.dumps({**run, "entries": entries, **changes}))
        outcome = invoke("import", "bam", source, "--out", tmp_path / "out")
        assert outcome.code == 2 and says in outcome.err and "run.json" in outcome.err
    (source / "run.json").write_text("[" * 100_000)
    assert invoke("import", "bam", source, "--out", tmp_path / "out").code == 2
    assert not (tmp_path / "lift.parquet").exists()


def test_a_log_whose_name_is_not_utf8(invoke, bench, tmp_path):
    log = tmp_path / "run\udcff.csv"
    log.write_text(pd.read_parquet(bench.logs[0]).to_csv(index=False))
    rig = tmp_path / "rig.yaml"
    assert invoke("inspect", log, "--rig", rig).code == 0
    assert "run\ufffd." in rig.read_text(encoding="utf-8")


@pytest.mark.usefixtures("fits_nothing")
def test_results_of_files_whose_names_are_not_utf8(invoke, bench, short_log, tmp_path):
    """Reports and models name them with a replacement character, and the project reads its own models back."""
    log, rig = tmp_path / "run\udcff.parquet", tmp_path / "rig\udcff.yaml"
    log.write_bytes(short_log.read_bytes())
    rig.write_text(bench.rig.read_text(encoding="utf-8"), encoding="utf-8")
    out = tmp_path / "out\udcff"
    assert invoke("check", "--rig", rig, "--log", log, "--out", out).code == 0
    page = (out / "check.html").read_text(encoding="utf-8")
    assert "rig\ufffd.yaml" in page and "run\ufffd" in page
    model = tmp_path / "model\udcff.yaml"
    assert invoke("identify", "--rig", rig, "--log", log, "--out", model).code == 0
    assert "run\ufffd.parquet" in model.read_text(encoding="utf-8")
    exported = invoke("export", model, "--to", "mjcf", "--out", tmp_path / "joint\udcff.xml")
    assert exported.code == 0, exported.err


def test_a_declared_file_whose_name_no_file_can_have(invoke, bench, tmp_path):
    rig = tmp_path / "rig.yaml"
    rig.write_text(yaml.safe_dump({**yaml.safe_load(bench.rig.read_text()), "declared": "a\0.urdf"}))
    line = invoke("identify", "--rig", rig, "--log", bench.logs[0]).refusal()
    assert "a\\x00.urdf: no such file; expected a URDF" in line


@pytest.mark.usefixtures("fits_nothing")
@pytest.mark.parametrize("gain", ["1e12", pytest.param("1e-20", marks=pytest.mark.slow)])
def test_a_drive_gain_beside_which_no_effect_has_a_size(invoke, bench, short_log, tmp_path, gain):
    rig = tmp_path / "rig.yaml"
    document = yaml.safe_load(bench.rig.read_text())
    document.pop("proportional_gain", None)
    rig.write_text(yaml.safe_dump({**document, "drive_gain": float(gain)}))
    done = invoke("check", "--rig", rig, "--log", short_log, "--json")
    assert (done.code, done.err) == (0, "") and json.loads(done.out)["name"] == "check"
