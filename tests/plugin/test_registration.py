"""Effects, tasks and limits registered from Python, and what is said of those that cannot be used."""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from drake_tc.actuation.model import EffectValue
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.effects.library import LIBRARY, UNCOMMON, effect, looked_for, place, register_effect
from drake_tc.effects.stribeck import Stribeck
from drake_tc.errors import ParamsError
from drake_tc.extensions import EFFECTS, LIMITS, TASKS
from drake_tc.tsid.kinds import LimitKind, TaskKind, register_limit, register_task

from .conftest import PACKAGE
from .seal_logs import write_bench


@pytest.fixture
def extras(monkeypatch):
    """The modules of the package, imported from its source."""
    monkeypatch.syspath_prepend(PACKAGE)
    yield tuple(import_module(f"joint_extras.{name}") for name in ("seal_drag", "mirror_task", "power_limit"))
    EFFECTS.remove("seal_drag")
    TASKS.remove("mirror")
    LIMITS.remove("joint_power")


def test_a_registered_effect_is_one_of_the_library_and_comes_last(extras):
    register_effect(extras[0].SealDrag)
    register_effect(extras[0].SealDrag())  # a notebook's cell that is run again
    assert type(effect("seal_drag")) is extras[0].SealDrag
    assert EffectValue("seal_drag", {"sine_drag": 0.1}).parameters == {"cosine_drag": 0.0, "sine_drag": 0.1}
    assert place("seal_drag") == len(LIBRARY) + len(UNCOMMON) > max(place(each.key) for each in (*LIBRARY, *UNCOMMON))


def test_close_loop_takes_effects_and_tries_no_others(extras, tmp_path):
    rig, logs, holdout = write_bench(tmp_path)
    register_effect(extras[0].SealDrag)
    seal = effect("seal_drag")
    options = DiagnosisOptions(effects=(effect("stribeck"), seal), assess_residual=False)
    with_it = close_loop(rig, logs, [holdout], options)
    assert [e.id for e in with_it.joints["axis"].effects] == ["seal_drag"]
    assert {r.id for r in with_it.joints["axis"].rejected} == {"stribeck"}
    text = rig.read_text("utf-8").replace("{rotor_inertia: 0.05}", "{rotor_inertia: 0.05, seal_drag: null}")
    rig.write_text(text, encoding="utf-8")
    declared = close_loop(rig, logs, [holdout], options).joints["axis"]
    assert declared.verdict == "no_missing_effect"
    assert declared.effects == ()


def test_options_refuse_effects_that_results_could_not_name(extras):
    with pytest.raises(ParamsError, match="no effect 'seal_drag'"):
        DiagnosisOptions(effects=(extras[0].SealDrag(),))

    class Other(Stribeck):
        pass

    with pytest.raises(ParamsError, match="the id 'stribeck' is taken by another effect"):
        DiagnosisOptions(effects=(Other(),))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"id": "stribeck"}, "effect 'stribeck': the library has an effect of this id"),
        ({"equation": "tau_add = c sin(q)"}, "expected Python expressions on both sides of ' = ', got 'c sin"),
        ({"equation": "tau_add = cosine_drag * torque"}, "no parameter or signal 'torque'; possible: J, K, "),
        ({"equation": "tau_add = cosine_drag * tanh(q)"}, "no function 'tanh'"),
        ({"equation": "tau_add == c * q"}, "expected expressions on both sides of ' = '"),
        ({"equation": "tau_add = [q]"}, r"no such thing as '\[q\]' in an equation"),
        ({"id": "seal drag"}, "expected an attribute `id` of letters, digits and underscores"),
        ({"columns": lambda self, s, shape: s.velocity}, r"expected shape \(5, 2\) for 5 samples, got \(5,\)"),
        ({"columns": lambda self, s, shape: s.volume}, "columns failed on a trial: AttributeError"),
        ({"columns": lambda self, s, shape: np.full((5, 2), np.nan)}, "columns are not finite"),
        ({"__init__": lambda self, size: None}, "cannot be made without arguments"),
    ],
)
def test_an_effect_that_cannot_be_used_is_refused_when_it_is_registered(extras, change, message):
    with pytest.raises(ParamsError, match=message):
        register_effect(type("Wrong", (extras[0].SealDrag,), change))


def test_what_is_no_effect_is_refused():
    with pytest.raises(ParamsError, match="expected an instance or a subclass of Effect"):
        register_effect(type("Nothing", (), {"id": "nothing"}))


def test_a_name_is_registered_once(extras):
    register_effect(extras[0].SealDrag)
    with pytest.raises(ParamsError, match="effect 'seal_drag': this name is already registered"):
        register_effect(type("Other", (extras[0].SealDrag,), {}))


def test_kinds_of_tasks_and_limits_are_registered_once_and_are_of_the_right_type(extras):
    register_task("mirror", extras[1].MIRROR)
    with pytest.raises(ParamsError, match="task kind 'com': this name is already taken"):
        register_task("com", extras[1].MIRROR)
    with pytest.raises(ParamsError, match="kind 'mine': expected a TaskKind"):
        register_task("mine", extras[2].JOINT_POWER)
    register_limit("joint_power", extras[2].JOINT_POWER)
    with pytest.raises(ParamsError, match="limit kind 'torque': this name is already taken"):
        register_limit("torque", extras[2].JOINT_POWER)
    with pytest.raises(ParamsError, match="kind 'mine': expected a LimitKind"):
        register_limit("mine", extras[1].MIRROR)
    assert isinstance(extras[1].MIRROR, TaskKind) and isinstance(extras[2].JOINT_POWER, LimitKind)


def test_an_entry_point_that_cannot_be_loaded_is_one_line(python, tmp_path):
    info = tmp_path / "broken-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n", "utf-8")
    (info / "entry_points.txt").write_text("[drake_tc.effects]\nrust = nowhere.rust:Rust\n", "utf-8")
    rig, logs, _ = write_bench(tmp_path / "bench")
    arguments = ["identify", "--rig", rig, "--log", logs[0], "--out", tmp_path / "model.yaml"]
    ran = python("-c", "from drake_tc.cli.entry import main; main()", *arguments, path=tmp_path)
    assert ran.returncode == 2
    last = ran.stderr.strip().splitlines()[-1]
    assert last == (
        "drake-tc: effect 'rust': its entry point 'nowhere.rust:Rust' of package 'broken' cannot be loaded:"
        " ModuleNotFoundError: No module named 'nowhere'"
    )
    assert "Traceback" not in ran.stderr


def test_looked_for_is_the_library_unless_told_otherwise():
    class Known:
        load, joint_type = "torque", "revolute"

    left_out = [each.key for each in LIBRARY if each not in looked_for(Known())]
    assert left_out == ["payload.sliding", "cable_spring.beside_weight", "presliding_hysteresis.sliding"]
    assert looked_for(Known(), LIBRARY[:2]) == LIBRARY[:2]
    assert replace(DiagnosisOptions(), effects=None).effects is None
    assert Path(PACKAGE, "pyproject.toml").exists()
