"""Uncommon effects: named where common ones only imitate them, and looked for nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.problem.estimates import estimates
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.selection import uncommon
from drake_tc.diagnosis.selection.joint import search
from drake_tc.diagnosis.selection.joint_problem import candidates
from drake_tc.diagnosis.thresholds import JOINT
from drake_tc.effects.library import LIBRARY, UNCOMMON

from ..rigs import Joint, record, rig_of

IMITATIONS = {"load_dependent_friction", "directional_efficiency", "saturation", "torque_sensor_gain"}


WAVES = {"torque_ripple", "position_dependent_friction", "encoder_eccentricity", "encoder_ripple"}


def found_in(bench: Joint, runs, common, among):
    """Columns of two runs, and the fit that the search over them ends with, of common effects by id and uncommon."""
    prepared = prepare_joint(runs, [], rig_of(bench), "joint")
    usual, seldom = (candidates(each, prepared.context, prepared.declared)[0] for each in (LIBRARY, among))
    usual = [each for each in usual if each.id in common]
    given = (prepared.train, prepared.terms, usual, prepared.context, prepared.floor, JOINT)
    return prepared.train, search(*given, uncommon=seldom).chosen


def look(bench: Joint, asked=lambda arrives: arrives, among=UNCOMMON):
    """What the search adds on two runs of a joint whose drive makes the recorded effort from the one that arrives."""
    runs = [record(bench, f"run{k}", float(k), k) for k in range(2)]
    runs = [replace(run, columns={**run.columns, "joint/current": asked(run.columns["joint/current"])}) for run in runs]
    declared = {"viscous", "coulomb"}
    return [t for t in found_in(bench, runs, IMITATIONS, among)[1].terms if t.effect.id not in declared]


def saturating_magnet(arrives):
    """The current at which a torque constant that falls as 1/(1 + (i/i_s)^2) makes these torques."""
    limit = 2.8 * np.abs(arrives).max()
    asked = arrives.copy()
    for _ in range(200):
        asked = arrives * (1.0 + (asked / limit) ** 2)
    return asked


def test_a_torque_constant_that_falls_with_the_current_is_named_by_its_nearest_effect():
    bench = Joint(torque_noise=0.02)
    imitated = {t.effect.id for t in look(bench, saturating_magnet, among=())}
    assert imitated
    assert imitated <= IMITATIONS
    assert [t.effect.id for t in look(bench, saturating_magnet)] == ["drive_compression"]


def test_an_effect_at_its_true_size_is_found():
    bench = Joint(torque_noise=0.02)
    half = 6.0 * np.abs(record(bench, "run", 0.0, 0).columns["joint/current"]).max()
    (term,) = look(bench, lambda arrives: arrives / (1.0 - np.abs(arrives) / half))
    assert term.effect.id == "drive_compression"
    assert term.shape["half_effort"] == pytest.approx(half, rel=0.01)


@pytest.mark.parametrize(("cosine", "sine", "cycles"), [(0.05, -0.03, 18.0)])
def test_a_torque_constant_that_varies_with_the_angle_is_found_at_its_size(cosine, sine, cycles):
    """Friction over the angle explains half of it: that has the sign of the motion, this wave that of the effort."""
    bench = Joint(torque_noise=0.05)
    runs = [record(bench, f"run{k}", float(k), k) for k in range(2)]
    varied = []
    for run in runs:
        q = run.columns["joint/position"]
        gain = 1.0 + cosine * np.cos(cycles * q) + sine * np.sin(cycles * q)
        varied.append(replace(run, columns={**run.columns, "joint/current": run.columns["joint/current"] / gain}))
    _, without = found_in(bench, varied, WAVES, ())
    columns, kept = found_in(bench, varied, WAVES, UNCOMMON)
    assert kept.cv_rms < 0.3 * without.cv_rms
    found = estimates(columns, kept, "current")["gain_ripple"]
    for name, true in (("gain_cosine", cosine), ("gain_sine", sine), ("cycles_per_turn", cycles)):
        low, high = found[name].ci95
        assert low - 0.25 * (high - low) <= true <= high + 0.25 * (high - low), (name, low, true, high)  # 3 deviations
    assert np.diff(found["gain_cosine"].ci95) < 0.02


def wandering(runs, size, seed=5):
    """The runs with a torque sensor that walks at random, to `size` [N m] (standard deviation) at the end of a run."""
    rng = np.random.default_rng(seed)
    steps = (rng.standard_normal(run.time.size) for run in runs)
    walks = [size * np.cumsum(step) / np.sqrt(step.size) for step in steps]
    return [
        replace(run, columns={**run.columns, "joint/torque": run.columns["joint/torque"] + walk})
        for run, walk in zip(runs, walks, strict=True)
    ]


@pytest.mark.parametrize(
    ("extra", "size"),
    [
        (lambda m: 0.8 * np.cos(18.0 * m.q), 0.0),
        (lambda m: 0.8 * np.cos(9.0 * m.q) * np.sign(m.v), 0.0),
        (lambda m: 0.2 * np.abs(m.tau) * np.sign(m.v), 0.1),
    ],
    ids=["cogging", "friction over the angle", "load-dependent friction"],
)
def test_no_varying_torque_constant_is_named_in_the_place_of_its_neighbours(extra, size):
    bench = Joint(torque_noise=0.05, extra=extra)
    runs = [record(bench, f"run{k}", float(k), k) for k in range(2)]
    _, kept = found_in(bench, wandering(runs, size), WAVES | {"load_dependent_friction"}, UNCOMMON)
    assert "gain_ripple" not in {t.effect.id for t in kept.terms}


@pytest.mark.parametrize(
    "extra", [None, lambda m: 0.15 * np.abs(m.tau) * np.sign(m.v)], ids=["nothing missing", "load-dependent friction"]
)
def test_no_uncommon_effect_is_looked_for_where_common_ones_leave_noise(extra, monkeypatch):
    monkeypatch.setattr(uncommon, "_least_error", lambda *args: pytest.fail("looked for"))
    found = look(Joint(torque_noise=0.25, extra=extra))
    assert [t.effect.id for t in found] == ([] if extra is None else ["load_dependent_friction"])
