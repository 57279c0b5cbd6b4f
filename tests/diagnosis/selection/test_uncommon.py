"""Uncommon effects: named where common ones only imitate them, and looked for nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.selection import uncommon
from drake_tc.diagnosis.selection.joint import search
from drake_tc.diagnosis.selection.joint_problem import candidates
from drake_tc.diagnosis.thresholds import JOINT
from drake_tc.effects.library import LIBRARY, UNCOMMON

from ..rigs import Joint, record, rig_of

IMITATIONS = {"load_dependent_friction", "directional_efficiency", "saturation", "torque_sensor_gain"}


def look(bench: Joint, asked=lambda arrives: arrives, among=UNCOMMON):
    """The search over two runs of a joint whose drive makes the recorded effort from the one that arrives."""
    runs = [record(bench, f"run{k}", float(k), k) for k in range(2)]
    runs = [replace(run, columns={**run.columns, "joint/current": asked(run.columns["joint/current"])}) for run in runs]
    prepared = prepare_joint(runs, [], rig_of(bench), "joint")
    common, seldom = (candidates(each, prepared.context, prepared.declared)[0] for each in (LIBRARY, among))
    common = [each for each in common if each.id in IMITATIONS]
    found = search(prepared.train, prepared.terms, common, prepared.context, prepared.floor, JOINT, uncommon=seldom)
    return [t for t in found.chosen.terms if t not in prepared.terms]


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


@pytest.mark.parametrize(
    "extra", [None, lambda m: 0.15 * np.abs(m.tau) * np.sign(m.v)], ids=["nothing missing", "load-dependent friction"]
)
def test_no_uncommon_effect_is_looked_for_where_common_ones_leave_noise(extra, monkeypatch):
    monkeypatch.setattr(uncommon, "_least_error", lambda *args: pytest.fail("looked for"))
    found = look(Joint(torque_noise=0.25, extra=extra))
    assert [t.effect.id for t in found] == ([] if extra is None else ["load_dependent_friction"])
