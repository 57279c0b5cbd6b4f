"""Model files: round trip, and refusals that say what was wanted."""

import numpy as np
import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import load_model_file, load_models, save_models
from drake_tc.effects.library import LIBRARY
from drake_tc.errors import ParamsError

GOOD = """
joints:
  knee:
    drive: {kind: position_servo, gain: 1.6e-4}
    effects:
      - {effect: viscous, viscous: 31.0, ci95: {viscous: [30.0, 32.0]}}
      - {effect: stribeck, stribeck: 5.1, stribeck_velocity: 0.08, stribeck_exponent: 2.0}
"""


def test_reads_the_documented_layout(tmp_path):
    (tmp_path / "m.yaml").write_text(GOOD)
    model = load_models(tmp_path / "m.yaml")["knee"]
    assert model.drive == Drive("position_servo", 1.6e-4)
    assert [value.key for value in model.effects] == ["viscous", "stribeck"]
    assert model.effects[0].ci95["viscous"] == (30.0, 32.0)


def test_round_trip_of_every_effect(tmp_path):
    rng = np.random.default_rng(0)
    effects = []
    for effect in LIBRARY:
        bounds = [(p.name, max(p.lower, -1.0), min(p.upper, 2.0)) for p in effect.parameters]
        effects.append(EffectValue(effect.key, {name: float(rng.uniform(a, b)) for name, a, b in bounds}))
    models = {"on": ActuatorModel("on", Drive("current", 1e-7 / 3), tuple(effects))}
    save_models(models, tmp_path / "m.yaml", provenance={"record": "run_3", "rms": 0.02})
    back = load_model_file(tmp_path / "m.yaml")
    assert back.provenance == {"record": "run_3", "rms": 0.02}
    assert back.models == models  # exact: floats are written in full
    text = (tmp_path / "m.yaml").read_text().splitlines()
    assert sum("effect:" in line for line in text) == len(LIBRARY)  # one line an effect


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "viscous: 31.0,",
            "vicous: 31.0,",
            ["joints.knee.effects[0]: unknown key 'vicous'; did you mean 'viscous'?; allowed: viscous, effect"],
        ),
        (
            "effect: stribeck",
            "effect: stribek",
            ["knee", "effects[1]: effect: no effect 'stribek'; did you mean 'stribeck'?; effects: "],
        ),
        ("viscous: 31.0,", "viscous: -1.0,", ["knee", "viscous.viscous", "expected 0 to inf, got -1", "N*m"]),
        ("viscous: 31.0,", "viscous: .nan,", ["joints.knee.effects[0].viscous: expected a number, got nan"]),
        ("viscous: 31.0,", "viscous: much,", ["joints.knee.effects[0].viscous: expected a number, got 'much'"]),
        ("viscous: 31.0, ", "", ["joints.knee.effects[0]: viscous is missing; expected a number [N*m*s/rad]"]),
        ("position_servo", "hydraulic", ["knee", "position_servo, current, voltage, torque", "hydraulic"]),
        ("gain: 1.6e-4", "gain: 0", ["joints.knee.drive.gain: expected a positive number, got 0"]),
        (
            "gain: 1.6e-4",
            "gian: 1",
            ["joints.knee.drive: unknown key 'gian'; did you mean 'gain'?; allowed: kind, gain"],
        ),
        ("    drive:", "    drvie:", ["joints.knee: unknown key 'drvie'; did you mean 'drive'?"]),
        ("joints:", "joint:", ["unknown key 'joint'; did you mean 'joints'?", "`drake-tc schema actuator --page`"]),
        (
            "[30.0, 32.0]",
            "[32.0, 30.0]",
            ["joints.knee.effects[0].ci95.viscous: expected [low, high] with low <= high, got [32.0, 30.0]"],
        ),
        ("stribeck: 5.1,", "stribeck: 5.1, stribeck: 6.0,", ["stribeck", "twice", "line 7"]),
        ("effects:", "effects: [", ["not valid YAML at line "]),
    ],
)
def test_refuses_in_one_line(tmp_path, old, new, words):
    assert old in GOOD
    path = tmp_path / "m.yaml"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(ParamsError) as error:
        load_models(path)
    message = str(error.value)
    assert "\n" not in message
    for word in ["m.yaml", *words]:
        assert word in message


def test_refuses_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ParamsError, match=r"nowhere\.yaml"):
        load_models(tmp_path / "nowhere.yaml")
