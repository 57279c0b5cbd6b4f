"""Ranges of randomisation: distributions against scipy.stats, files written by hand, and programs."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest
import scipy.special
import scipy.stats

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import save_models
from drake_tc.cli.main import run
from drake_tc.errors import ParamsError
from drake_tc.exchange.ranges.posterior import draws, posterior_of
from drake_tc.exchange.ranges.program import term_ranges
from drake_tc.exchange.ranges.simulators import to_isaaclab_events, to_mjlab, to_playground
from drake_tc.exchange.ranges.unit import Distribution, deviation_of, distribution, of_units, read_unit, spread_between

from .released_names import installed, is_installed, released, wrong_names

SHARES = np.linspace(0.001, 0.999, 41)


def test_a_normal_parameter_is_cut_off_at_its_limits():
    of = Distribution("normal", 1.0, 0.8, 0.0, 2.0)
    expected = scipy.stats.truncnorm(-1.0 / 0.8, 1.0 / 0.8, loc=1.0, scale=0.8)
    np.testing.assert_allclose(of.quantile(SHARES), expected.ppf(SHARES), rtol=1e-9)


def test_a_lognormal_parameter_has_its_value_as_median():
    of = distribution(0.2, 0.15, 0.0)
    scale = math.sqrt(math.log(1.0 + (0.15 / 0.2) ** 2))
    assert of.law == "lognormal"
    np.testing.assert_allclose(of.quantile(SHARES), scipy.stats.lognorm(scale, scale=0.2).ppf(SHARES), rtol=1e-9)


@pytest.mark.parametrize(
    ("value", "deviation", "lower", "law"),
    [(1.0, 0.1, 0.0, "normal"), (1.0, 0.3, 0.0, "lognormal"), (1.0, 0.3, -np.inf, "normal"), (0.0, 0.3, 0.0, "normal")],
)
def test_a_positive_parameter_whose_deviation_reaches_0_is_lognormal(value, deviation, lower, law):
    assert distribution(value, deviation, lower).law == law


def test_the_end_that_a_limit_cut_off_does_not_count():
    assert deviation_of(0.5, (0.0, 2.46)) == pytest.approx(1.0, rel=1e-3)
    low, high = distribution(3.0, deviation_of(3.0, (2.0, 4.0)), 0.0).interval
    assert (low, high) == pytest.approx((2.0, 4.0), abs=1e-6)


def test_the_spread_between_fits_of_equal_deviation_is_what_their_variance_has_more():
    x = [1.0, 1.5, 2.6, 0.7]
    assert spread_between(x, [0.2] * 4) == pytest.approx(math.sqrt(np.var(x, ddof=1) - 0.2**2))
    assert spread_between(x, [3.0] * 4) == 0.0


def test_a_further_unit_has_the_spread_between_units():
    rng = np.random.default_rng(0)
    truth = rng.normal(5.0, 0.5, 4000)
    pooled = of_units([distribution(float(rng.normal(x, 0.2)), 0.2, 0.0) for x in truth])
    assert pooled.value == pytest.approx(5.0, abs=0.05)
    assert pooled.deviation == pytest.approx(0.5, rel=0.05)
    alone = distribution(5.0, 0.2, 0.0)
    assert of_units([alone]) is alone


def estimate(value, low, high):
    return {"value": value, "unit": "-", "ci95": [low, high], "at_bound": False}


def folder(path, *, gain=2e-4, viscous=20.0, intervals=True, **changes):
    """model_after.yaml, report.json and check.json of a knee with declared inertia, delay and Stribeck friction."""
    path.mkdir(parents=True, exist_ok=True)
    own = {"viscous": (viscous - 2.0, viscous + 2.0)} if intervals else {}
    peak = {"stribeck": 2.0, "stribeck_velocity": 0.1, "stribeck_exponent": 2.0}
    ends = {"stribeck": (1.0, 3.0), "stribeck_velocity": (0.05, 0.15), "stribeck_exponent": (0.5, 2.0)}
    effects = (
        EffectValue("rotor_inertia", {"rotor_inertia": 0.3}),
        EffectValue("viscous", {"viscous": viscous}, own),
        EffectValue("coulomb", {"coulomb": 4.0}, {"coulomb": (3.0, 5.0)}),
        EffectValue("stribeck", peak, ends),
    )
    save_models({"knee": ActuatorModel("knee", Drive("position_servo", gain), effects)}, path / "model_after.yaml")
    rejected = [
        {
            "id": "thermal_friction",
            "key": "thermal_friction",
            "reason": "not_recorded",
            "why": "temperature not recorded",
        },
        {"id": "backlash", "key": "backlash", "reason": "too_little_evidence", "why": "tried"},
        {"id": "saturation", "key": "saturation", "reason": "too_little_evidence", "why": "tried"},
    ]
    knee = {
        "parameters": {
            "drive": {"gain": estimate(gain, 0.95 * gain, 1.05 * gain)},
            "viscous": {"viscous": estimate(20.0, 18.0, 22.0)},
        },
        "plausible": {"stribeck": {"stribeck_exponent": {"range": [0.5, 2.0], "source": "published"}}},
        "gain_identified": True,
        "rejected": rejected,
    }
    (path / "report.json").write_text(json.dumps({"schema": 1, "joints": {"knee": knee | changes}}))
    sizes = [
        {"key": "backlash", "status": "seen", "size": {"name": "backlash", "unit": "rad", "smallest": 0.001}},
        {"key": "saturation", "status": "seen", "size": {"name": "limit", "unit": "rad", "smallest": 0.02}},
    ]
    (path / "check.json").write_text(json.dumps({"joints": {"knee": {"motion": {"speed": 2.0}, "effects": sizes}}}))
    return path / "model_after.yaml"


def by_key(unit):
    return {each.key: each for each in unit.estimated["knee"]}


def test_intervals_come_from_the_model_file_and_the_report(tmp_path):
    found = by_key(read_unit(folder(tmp_path)))
    assert found["drive", "gain"].distribution.deviation == pytest.approx(0.05 * 2e-4 / 1.96, rel=1e-3)
    assert found["viscous", "viscous"].distribution.interval == pytest.approx((18.0, 22.0), abs=1e-6)
    assert set(found) == {("drive", "gain"), ("viscous", "viscous"), ("coulomb", "coulomb")} | {
        ("stribeck", name) for name in ("stribeck", "stribeck_velocity")
    }


def test_what_the_logs_could_not_show_is_named_with_the_range_of_the_prior(tmp_path):
    shown = {(each.effect, each.parameter): each for each in read_unit(folder(tmp_path)).not_shown}
    assert shown["rotor_inertia", "rotor_inertia"].why == "it has no interval: it is declared, or held in the fit"
    assert shown["stribeck", "stribeck_exponent"].why == "its interval is as wide as what is possible"
    rate = shown["thermal_friction", "thermal_rate"]
    assert (rate.lower, rate.upper, rate.why) == (1e-4, 0.2, "temperature not recorded")
    assert (shown["backlash", "backlash"].lower, shown["backlash", "backlash"].upper) == (0.0, 0.001)
    assert shown["backlash", "backlash"].found_above
    limit = shown["saturation", "limit"]
    assert (limit.lower, limit.upper) == (0.02, math.inf)


def test_a_gain_that_the_logs_do_not_tell_is_not_randomised(tmp_path):
    unit = read_unit(folder(tmp_path, gain_identified=False))
    assert ("drive", "gain") not in by_key(unit)
    assert ("drive", "gain") in {(each.effect, each.parameter) for each in unit.not_shown}


def test_refined_numbers_are_as_uncertain_as_they_differ(tmp_path):
    model = folder(tmp_path, viscous=23.0, intervals=False)
    found = by_key(read_unit(model))["viscous", "viscous"]
    assert found.parts == pytest.approx({"interval": 2.0 / 1.959964, "refinement": 3.0}, rel=1e-5)
    assert found.distribution.value == 23.0
    assert found.distribution.deviation == pytest.approx(math.hypot(2.0 / 1.959964, 3.0), rel=1e-5)


def test_doubts_of_the_report_are_told(tmp_path):
    model = folder(tmp_path, indistinguishable=[["stribeck", "deadzone"]])
    report = json.loads((tmp_path / "report.json").read_text())
    (tmp_path / "report.json").write_text(json.dumps(report | {"verdict": "unexplained_residual"}))
    notes = read_unit(model).notes
    assert notes[0].startswith("The verdict is unexplained_residual: more is left than noise explains")
    assert notes[1].startswith("knee: the logs cannot distinguish stribeck from deadzone")


def test_draws_have_the_correlation_of_the_report(tmp_path):
    names = ["coulomb.coulomb", "viscous.viscous"]
    model = folder(tmp_path, correlation={"names": names, "matrix": [[1.0, -0.8], [-0.8, 1.0]]})
    posterior = posterior_of([read_unit(model)])
    drawn = draws(posterior, 20_000, 1)["knee"]
    keys = [".".join(each.key) for each in posterior.unit.estimated["knee"]]
    found = np.corrcoef(drawn[:, [keys.index(name) for name in names]], rowvar=False)[0, 1]
    assert found == pytest.approx(-0.8, abs=0.02)
    assert not any("correlation" in note for note in posterior.notes)
    alone = draws(posterior_of([read_unit(folder(tmp_path / "other"))]), 20_000, 1)["knee"]
    assert abs(np.corrcoef(alone[:, :3], rowvar=False)[1, 2]) < 0.03


def test_several_units_widen_the_ranges(tmp_path):
    models = [folder(tmp_path / str(k), viscous=v, intervals=True) for k, v in enumerate((16.0, 20.0, 24.0))]
    posterior = posterior_of([read_unit(each) for each in models])
    found = by_key(posterior.unit)["viscous", "viscous"]
    assert found.distribution.value == pytest.approx(20.0)
    assert found.parts["units"] == pytest.approx(math.sqrt(16.0 - (2.0 / 1.96) ** 2), rel=1e-3)
    assert not any("--unit" in note for note in posterior.notes)


RANGES = {"mjlab": to_mjlab, "isaaclab": to_isaaclab_events, "playground": to_playground}


def program(tmp_path, target, **changes):
    posterior = posterior_of([read_unit(folder(tmp_path, **changes))])
    ranges = term_ranges(posterior, target, draws(posterior, 400, 0))
    return RANGES[target](posterior, ranges), ranges


@pytest.mark.parametrize("package", ["mjlab", "isaaclab"])
def test_programs_use_names_of_the_released_package(package, tmp_path):
    text, _ = program(tmp_path, package)
    assert wrong_names(text, package) == []
    assert wrong_names(text.replace('"operation"', '"operatoin"'), package)


@pytest.mark.parametrize("package", ["mjlab", "isaaclab"])
def test_the_list_of_names_is_that_of_the_installed_package(package):
    if not is_installed(package):
        pytest.skip(f"{package} {released()[package]['version']} is not installed")
    for name, fields in released()[package]["names"].items():
        assert installed(name) == fields, name


def numpy_as_torch():
    """The few functions of torch that the programs use, by NumPy and SciPy."""
    return SimpleNamespace(special=scipy.special, exp=np.exp, clip=np.clip)


@pytest.mark.parametrize("target", ["mjlab", "isaaclab", "playground"])
def test_a_program_draws_from_the_same_distribution(target, tmp_path):
    text, _ = program(tmp_path, target)
    body = (
        text[text.index("def quantile") : text.index("def bounded" if target == "mjlab" else "def set_joint")]
        if (target != "playground")
        else text[text.index("def quantile") : text.index("def drawn")]
    )
    scope = {"math": math, "torch": numpy_as_torch(), "jp": np, "jax": SimpleNamespace(scipy=scipy)}
    exec(body, scope)
    for of in (
        Distribution("normal", 1.0, 0.8, 0.0, 2.0),
        Distribution("normal", 3.0, 0.1),
        Distribution("lognormal", 0.2, 0.15, 0.0, 0.5),
        Distribution("lognormal", 0.2, 0.15, 0.0),
    ):
        found = scope["quantile"]((of.law, of.value, of.deviation, of.lower, of.upper), SHARES)
        np.testing.assert_allclose(found, of.quantile(SHARES), rtol=1e-9)


def test_terms_keep_the_correlation_of_the_parameters(tmp_path):
    names = ["coulomb.coulomb", "viscous.viscous"]
    text, (ranges,) = program(tmp_path, "mjlab", correlation={"names": names, "matrix": [[1.0, -0.9], [-0.9, 1.0]]})
    assert set(ranges.distributions) == {"kp", "damping", "frictionloss"}
    gain = ranges.distributions["kp"]
    assert gain.value == pytest.approx(5000.0, rel=0.01)
    assert gain.deviation / gain.value == pytest.approx(0.05 / 1.96, rel=0.15)
    names = list(ranges.distributions)
    found = ranges.correlation[names.index("damping"), names.index("frictionloss")]
    assert -0.9 < found < -0.4
    assert f"damping and frictionloss have the correlation {found:.2f}; drawn independently" in text


def servo_with_limit(tmp_path):
    """A servo whose limit acts on its damping too: 500 N m s/rad of its own, 1500 N m s/rad of the joint."""
    limit = EffectValue("saturation.servo", {"limit": 0.1, "derivative_time": 0.1}, {"limit": (0.09, 0.11)})
    viscous = EffectValue("viscous", {"viscous": 2000.0}, {"viscous": (1900.0, 2100.0)})
    model = ActuatorModel("knee", Drive("position_servo", 2e-4), (viscous, limit))
    save_models({"knee": model}, tmp_path / "model.yaml")
    return posterior_of([read_unit(tmp_path / "model.yaml")])


@pytest.mark.parametrize("target", ["mjlab", "playground", "isaaclab"])
def test_the_damping_of_the_joint_is_without_that_of_the_servo(target, tmp_path):
    posterior = servo_with_limit(tmp_path)
    (ranges,) = term_ranges(posterior, target, draws(posterior, 400, 0))
    assert ranges.projection.terms.derivative_gain == pytest.approx(500.0)
    assert ranges.distributions["damping"].value == pytest.approx(1500.0, rel=0.01)
    assert ranges.distributions["torque_limit"].value == pytest.approx(500.0, rel=0.01)


@pytest.mark.parametrize("target", ["mjlab", "isaaclab"])
def test_the_damping_of_the_joint_is_without_the_back_emf(target, tmp_path):
    viscous = EffectValue("viscous", {"viscous": 4.0}, {"viscous": (3.8, 4.2)})
    limit = EffectValue("saturation", {"limit": 9.0}, {"limit": (8.0, 10.0)})
    peak = EffectValue("stribeck", {"stribeck": 0.5, "stribeck_velocity": 0.2, "stribeck_exponent": 2.0})
    dry = EffectValue("coulomb", {"coulomb": 1.0}, {"coulomb": (0.9, 1.1)})
    save_models(
        {"knee": ActuatorModel("knee", Drive("voltage", 0.5), (viscous, limit, dry, peak))}, tmp_path / "m.yaml"
    )
    posterior = posterior_of([read_unit(tmp_path / "m.yaml")])
    (plain,) = term_ranges(posterior, target, draws(posterior, 400, 0))
    (motor,) = term_ranges(posterior, target, draws(posterior, 400, 0), torque_constant=1.2)
    less = plain.distributions["damping"].value - motor.distributions["damping"].value
    refitted = plain.projection.terms.damping - motor.projection.terms.damping
    assert less == pytest.approx(refitted + 1.2 / 0.5, rel=0.05)
    text = RANGES[target](posterior, [motor])
    assert ("dr.joint_friction" in text, "dr.effort_limits" in text) == (False, False)
    assert ("knee frictionloss" in text) == (target == "mjlab")  # in the motor's lugre, which no term draws


def test_the_samples_are_a_table_with_its_units(tmp_path):
    model, out = folder(tmp_path), tmp_path / "samples.parquet"
    assert run(["export", str(model), "--ranges", "--to", "parquet", "--samples", "300", "--out", str(out)]) == 0
    table = pq.read_table(out)
    assert table.num_rows == 300
    assert table.schema.field("knee/viscous.viscous").metadata[b"unit"] == b"N*m*s/rad"
    told = json.loads(table.schema.metadata[b"drake_tc"])
    (viscous,) = [each for each in told["joints"]["knee"]["parameters"] if each["parameter"] == "viscous"]
    column = table.column("knee/viscous.viscous").to_numpy()
    assert np.mean((column > viscous["central95"][0]) & (column < viscous["central95"][1])) == pytest.approx(
        0.95, abs=0.04
    )
    same = tmp_path / "again.parquet"
    assert run(["export", str(model), "--ranges", "--to", "parquet", "--samples", "300", "--out", str(same)]) == 0
    assert pq.read_table(same).equals(table)


def test_the_document_has_everything_that_the_tables_show(tmp_path, capsys):
    assert run(["export", str(folder(tmp_path)), "--ranges", "--to", "mjlab", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["terms"]["knee"]["damping"]["unit"] == "N m s/rad"
    assert {each["effect"] for each in document["joints"]["knee"]["not_shown"]} >= {"thermal_friction", "backlash"}
    assert any("correlation" in note for note in document["notes"])
    assert any("mjlab has no Stribeck friction" in line for line in document["losses"])


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--ranges", "--to", "mjcf"], "expected --to mjlab, isaaclab, playground, parquet, got --to mjcf"),
        (["--ranges", "--to", "parquet"], "expected --out FILE.parquet"),
        (["--ranges", "--to", "mjlab", "--joint", "hip"], "no joint 'hip'"),
        (["--ranges", "--to", "mjlab", "--into", "robot.xml"], "--into has no use here"),
        (["--to", "parquet"], "add --ranges"),
        (["--to", "mjcf", "--unit", "other.yaml"], "--unit belongs to --ranges"),
    ],
)
def test_a_request_that_cannot_be_met_is_refused(arguments, expected, tmp_path, capsys):
    assert run(["export", str(folder(tmp_path)), *arguments]) == 2
    assert expected in capsys.readouterr().err


def test_files_that_do_not_fit_are_refused(tmp_path):
    model = folder(tmp_path)
    (tmp_path / "report.json").write_text("[]")
    with pytest.raises(ParamsError, match=r"report\.json: expected report\.json of close-loop"):
        read_unit(model)
    (tmp_path / "report.json").write_text('{"joints": {"hip": {}}}')
    with pytest.raises(ParamsError, match="no joint 'knee'"):
        read_unit(model)
    folder(tmp_path, rejected=[{"id": "backlash"}])
    with pytest.raises(ParamsError, match="joint 'knee': expected the entries that close-loop writes, got KeyError"):
        read_unit(model)
    bare = tmp_path / "bare" / "model.yaml"
    bare.parent.mkdir()
    save_models({"knee": ActuatorModel("knee", Drive("current", 0.4))}, bare)
    with pytest.raises(ParamsError, match=r"no parameter has a 95 % interval"):
        read_unit(bare)
