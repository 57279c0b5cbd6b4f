"""A twin moves as the joint did, and a rehearsal finds a large effect and none where there is none."""

from dataclasses import replace

import numpy as np
import pytest
from few_effects import diagnoses_look_for, twins_show
from numpy.testing import assert_allclose

from drake_tc.errors import ParamsError
from drake_tc.experiments.causes import CAUSES, cause_values, size_in
from drake_tc.experiments.rehearsal.run import (
    PowerPoint,
    Rehearsal,
    half_power,
    parse_effect,
    rehearsal_json,
    rehearsal_page,
    rehearse,
    share_interval,
    summary,
)
from drake_tc.experiments.rehearsal.twin import twin_of
from drake_tc.experiments.sizes import Size
from drake_tc.logs.loads import UnknownLoad
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig


@pytest.fixture(scope="module")
def read(demo):
    rig = load_rig(demo[0])
    return rig, load_runs([*demo[1][:1], *demo[2]], rig)


@pytest.fixture(scope="module")
def twin(read):
    rig, runs = read
    with pytest.MonkeyPatch.context() as patch:
        twins_show(patch, "cable_spring", "stribeck", "thermal_friction", "rotor_inertia")
        return twin_of(rig, runs, rig.joints[0])


@pytest.fixture(scope="module")
def simulated(twin):
    """The twin's runs with the seed 3."""
    return twin.simulator.simulated({}, 3, twin.runs)


def test_the_twin_repeats_the_recorded_motion_with_the_recorded_load(simulated, read):
    rig, runs = read
    joint = rig.joints[0]
    for recorded, made in zip(runs, simulated, strict=True):
        assert set(made.columns) == set(recorded.columns)
        for name, share in ((f"{joint}/position", 0.02), (f"{joint}/torque", 0.15)):
            inner = slice(200, -200)
            apart = made.columns[name][inner] - np.interp(made.time, recorded.time, recorded.columns[name])[inner]
            # the twin has the declared model only: the joint's missing friction changes its motion by that much
            assert np.sqrt(np.mean(apart**2)) < share * np.ptp(recorded.columns[name]), (recorded.name, name)


def test_the_same_seed_gives_the_same_runs_and_another_one_other_noise(twin, simulated):
    same, other = (twin.simulator.simulated({}, seed, twin.runs[:1])[0].columns for seed in (3, 4))
    torque = f"{twin.simulator.joint}/torque"
    assert_allclose(same[torque], simulated[0].columns[torque], rtol=0.0, atol=0.0)
    assert np.std(same[torque] - other[torque]) > 0.0


def test_a_large_effect_is_found_and_counted_by_size_and_none_where_there_is_none(twin, monkeypatch):
    diagnoses_look_for(monkeypatch, "cable_spring", "stribeck")
    found = rehearse(twin, "cable_spring", 8.0, [twin.runs[-1].name], repeats=1, factors=(1.0,))
    assert [p.size for p in found.points] == [0.0, 8.0]
    assert found.points[0].found == 0
    assert found.points[1].found == 1 and found.points[1].trials == 1
    assert "found in half of the trials" in summary(found)
    document = rehearsal_json(found)
    assert document["effect"] == "cable_spring" and document["found_from"] == 8.0
    assert "Would it have been found?" in rehearsal_page(found)


@pytest.mark.parametrize("effect_id", sorted(CAUSES))
def test_the_size_of_an_effect_and_the_numbers_of_its_cause_belong_together(twin, effect_id):
    from dataclasses import replace

    rng = np.random.default_rng(4)
    values = cause_values(effect_id, 0.37, twin.simulator.spec.joint, None, rng)
    spec = replace(twin.simulator.spec, causes={effect_id: values})
    assert_allclose(size_in(spec, effect_id), 0.37, rtol=1e-12)


def test_the_size_of_a_payload_on_a_pendulum_is_its_least_moment(twin):
    """The ratio of inertia to moment, written out, for a mass with an arm and for the size of its effect."""
    from dataclasses import replace

    mass, arm, pendulum = 2.0, 0.3, (4.0, 0.5)
    own, gravity = pendulum[0] * pendulum[1] ** 2, pendulum[0] * 9.81 * pendulum[1]
    joint = replace(twin.simulator.spec.joint, link_inertia=own, gravity=gravity)
    spec = replace(twin.simulator.spec, joint=joint, pendulum=pendulum, causes={"payload": {"mass": mass, "arm": arm}})
    inertia = joint.rotor_inertia + own
    ratio = (inertia + mass * arm**2) / (gravity + mass * 9.81 * arm)
    assert_allclose(inertia / (gravity + size_in(spec, "payload")), ratio, rtol=1e-12)
    values = cause_values("payload", 5.0, joint, pendulum, np.random.default_rng(0))
    assert_allclose(size_in(replace(spec, causes={"payload": values}), "payload"), 5.0, rtol=0.01)


def test_the_interval_of_a_share_is_that_of_the_binomial_distribution():
    assert share_interval(0, 4)[0] == 0.0 and share_interval(4, 4)[1] == 1.0
    assert_allclose(share_interval(4, 4)[0], 0.025**0.25, rtol=1e-9)  # P(4 of 4) = p^4
    assert_allclose(share_interval(0, 4)[1], 1.0 - 0.025**0.25, rtol=1e-9)


def test_half_power_is_the_size_above_which_half_are_found():
    def point(size, found):
        return PowerPoint(size, 4, found, found, (0.0, 1.0), {})

    assert half_power([point(0.0, 0), point(1.0, 1), point(2.0, 3), point(4.0, 4)]) == 2.0
    assert half_power([point(1.0, 3), point(2.0, 1)]) == np.inf
    size = Size("mu", "-", 1.0)
    assert "none of the tried sizes" in summary(Rehearsal("j", "stribeck", size, 1.0, (point(1.0, 0),), ()))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("magic", "no effect"),
        ("viscous=1", "the simulator has no"),
        ("stribeck=x", "number"),
        ("stribeck=-1", "positive"),
    ],
)
def test_what_cannot_be_put_in_is_one_line(text, words):
    with pytest.raises(ParamsError, match=words):
        parse_effect(text)


def test_an_effect_that_these_logs_cannot_show_is_refused(twin):
    with pytest.raises(ParamsError, match="temperature not recorded"):
        rehearse(twin, "thermal_friction", None, [twin.runs[-1].name])
    with pytest.raises(ParamsError, match="declared in the rig file"):
        rehearse(twin, "rotor_inertia", None, [twin.runs[-1].name])


def test_an_unknown_load_cannot_be_simulated_and_is_refused_in_one_line(read):
    rig, runs = read
    joint = rig.joints[0]
    with pytest.raises(ParamsError, match="load: unknown; give the rig file load") as caught:
        twin_of(replace(rig, load={joint: UnknownLoad("pendulum")}), runs, joint)
    assert "\n" not in str(caught.value)
