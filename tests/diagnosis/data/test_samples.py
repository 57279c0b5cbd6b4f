"""From runs to rows: common filters, direction and travel, which samples may speak, and what the sensors resolve."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.notes import SilentEffort
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.effects.library import effect
from drake_tc.errors import IdentificationError
from drake_tc.logs.record import Run

from ..rigs import Joint, motion, problem, record, rig_of

JOINT = Joint()


def run_along(q: np.ndarray, period: float = 2e-3, segment: np.ndarray | None = None) -> Run:
    """A run with a given motion; command and torque do not matter."""
    time = np.arange(q.size) * period
    columns = {"joint/position": q, "joint/current": np.sin(time), "joint/torque": np.cos(time)}
    used = np.zeros(q.size, np.int64) if segment is None else segment
    return Run("made", None, time, period, columns, used)


@pytest.mark.parametrize("width", [0.012, 0.04, 0.08])
def test_common_filters_keep_a_linear_balance_exact_whatever_their_width(width):
    joint = replace(JOINT, coulomb=0.0)
    samples = build_samples([record(joint)], rig_of(joint), "joint", width_s=width)
    found = fit(Columns(samples), [Term(effect("viscous"))])
    # only the position is logged: velocity and acceleration are the kernel's own, and still no residual appears
    assert_allclose(1.0 / found.beta[0], joint.gain, rtol=1e-6)
    assert_allclose(found.beta[1], joint.viscous, rtol=1e-5)
    assert found.rms / found.gain < 1e-5 * np.std(samples.signals.load_torque)


def test_signals_follow_the_closed_form_of_the_motion():
    samples = problem(JOINT).samples
    m, rows = motion(JOINT), samples.rows
    # 12 ms against motions below 1 Hz: the kernel is exact to cubics, its next term is of order (w sigma)^4
    assert_allclose(samples.signals.position[rows], m.q[rows], atol=1e-6)
    assert_allclose(samples.signals.velocity[rows], m.v[rows], atol=1e-5)
    assert_allclose(samples.signals.acceleration[rows], m.a[rows], atol=1e-4)


def test_direction_and_travel_of_a_swing():
    time = np.arange(10_000) * 2e-3
    q = 0.5 * np.sin(2 * np.pi * 0.25 * time)  # turns at 1, 3, 5 ... s
    s = build_samples([run_along(q)], rig_of(JOINT), "joint")
    away = np.abs((time + 1.0) % 2.0 - 0.0) > 0.05
    away &= (2.0 - (time + 1.0) % 2.0 > 0.05) & (time > 0.2) & (time < 19.8)
    wanted = np.where((time + 1.0) % 4.0 < 2.0, 1.0, -1.0)
    assert_allclose(s.signals.direction[away], wanted[away])
    since = away & (time > 1.0)
    turned_at = np.floor((time + 1.0) / 2.0) * 2.0 - 1.0
    start = 0.5 * np.sin(2 * np.pi * 0.25 * turned_at)
    assert_allclose(s.signals.travel[since], np.abs(q - start)[since], atol=2e-4)  # the turn is seen to one sample


def test_a_stop_is_no_reversal():
    time = np.arange(6000) * 2e-3
    # forth for 2 s, still for 2 s, on in the same direction for 4 s, then back
    speed = np.select([time < 2, time < 4, time < 8], [0.4, 0.0, 0.4], -0.4)
    q = np.cumsum(speed) * 2e-3
    s = build_samples([run_along(q)], rig_of(JOINT), "joint")
    still, later, back = (time > 2.2) & (time < 3.8), (time > 4.5) & (time < 7.5), (time > 8.5) & (time < 11.5)
    assert not s.moving[still].any()
    assert s.moving[later].all()
    assert s.moving[back].all()
    assert_allclose(s.signals.direction[later], 1.0)
    assert_allclose(s.signals.direction[back], -1.0)
    assert_allclose(s.signals.travel[back], np.max(q) - q[back], atol=5e-3)
    bristle = effect("presliding_hysteresis").columns(s.signals, {"presliding_travel": 0.3})[:, 0]
    wound = np.exp(-(np.max(q) - q) / 0.3)
    assert_allclose(bristle[later], 0.0, atol=0.1)  # wound up before the stop, and still so after it
    assert_allclose(bristle[back], 2.0 * wound[back], atol=0.1)  # z = 1 at the turn


@pytest.mark.parametrize("dwell", [0.0, 1.0])
def test_a_joint_that_stood_still_slides_again_after_a_millimetre_at_one_metre(dwell):
    """At rest friction follows the load, so after a stop it is wound anew, in the direction of the last motion too.

    A motion that merely slows down does not stop, whatever the encoder resolves.
    """
    time = np.arange(8000) * 1e-3
    slow = np.clip((time - 4.0) / 2.0, 0.0, 1.0) * 0.02
    speed = np.where(time < 3.0, 0.2, np.where(time < 4.0, 0.003 if dwell == 0.0 else 0.0, slow))
    q = np.cumsum(speed) * 1e-3 + 1e-5 * np.random.default_rng(3).standard_normal(time.size)
    s = build_samples([run_along(q)], rig_of(JOINT), "joint")
    seen = (np.abs(s.signals.velocity) > s.resolution.least_speed) & (time > 4.2) & (time < 7.5)
    travelled = q - q[4000]
    early = seen & (travelled < 0.9e-3)
    assert np.count_nonzero(early) > 50
    assert s.moving[early].any() == (dwell == 0.0)
    assert s.moving[seen & (travelled > 1.2e-3)].all()


def test_a_still_joint_with_a_noisy_encoder_does_not_move():
    rng = np.random.default_rng(0)
    time = np.arange(6000) * 2e-3
    q = np.where(time < 6.0, 0.5 * np.sin(2 * np.pi * 0.5 * time), 0.0) + 1e-4 * rng.standard_normal(time.size)
    s = build_samples([run_along(q)], rig_of(JOINT), "joint")
    assert s.moving[(time > 1.0) & (time < 5.9)].mean() > 0.8
    assert not s.moving[time > 6.2].any()


def test_rows_keep_away_from_starts_ends_gaps_and_reversals():
    time = np.arange(10_000) * 2e-3
    q = 0.5 * np.sin(2 * np.pi * 0.25 * time)
    segment = np.where((time > 8.0) & (time < 9.0), -1, np.where(time <= 8.0, 0, 1)).astype(np.int64)
    s = build_samples([run_along(q, segment=segment)], rig_of(JOINT), "joint")
    assert [x.stop - x.start for x in s.segments] == [int((segment == k).sum()) for k in (0, 1)]
    when, speed = s.signals.time[s.rows], np.abs(0.25 * np.pi * np.cos(2 * np.pi * 0.25 * s.signals.time[s.rows]))
    margin = (s.light.margin + s.kernel.margin) * 2e-3
    assert when.min() >= margin
    assert not ((when > 8.0 - margin) & (when < 9.0 + margin)).any()
    assert when.max() <= 20.0 - margin
    assert speed.min() > 0.0
    turn = np.abs((when + 1.0) % 2.0 - 1.0)  # 1 at a reversal
    assert turn.max() < 0.995
    after = (when > 1.0) & ((when + 1.0) % 2.0 < 1.0)
    moved = 0.5 - np.abs(0.5 * np.sin(2 * np.pi * 0.25 * when))
    assert moved[after].min() > 1e-3  # the first millimetre after a reversal is left out


def test_blocks_never_span_a_gap_or_two_runs():
    time = np.arange(5000) * 2e-3
    q = 0.5 * np.sin(2 * np.pi * 0.25 * time)
    segment = np.where((time > 4.1) & (time < 4.2), -1, (time >= 4.2).astype(int)).astype(np.int64)
    runs = [replace(run_along(q, segment=segment), name=n) for n in ("a", "b")]
    s = build_samples(runs, rig_of(JOINT), "joint")
    piece = np.searchsorted([x.stop for x in s.segments], s.rows, side="right")
    for block in np.unique(s.block):
        inside = s.block == block
        assert len(set(piece[inside])) == 1
        assert np.ptp(s.signals.time[s.rows][inside]) < 0.5
    assert set(s.run) == {0, 1}
    assert s.runs == ("a", "b")


def test_resolution_of_a_quantised_encoder_is_its_step():
    step = 2 * np.pi / 4096
    s = build_samples([record(replace(JOINT, encoder_step=step))], rig_of(JOINT), "joint")
    assert_allclose(s.resolution.position_step, step, rtol=1e-6)
    assert_allclose(s.resolution.position_noise, step / np.sqrt(12.0), rtol=0.5)
    assert s.light.width_s > problem(JOINT).samples.light.width_s


def test_white_noise_of_both_sensors_is_measured():
    joint = replace(JOINT, encoder_noise=3e-4, torque_noise=0.2)
    r = problem(joint).samples.resolution
    assert r.position_step == 0.0
    assert_allclose(r.position_noise, 3e-4, rtol=0.1)  # median of 8000 differences: 2 % standard error
    assert_allclose(r.torque_noise, 0.2, rtol=0.1)


def test_a_joint_that_never_moves_is_refused():
    rng = np.random.default_rng(0)
    with pytest.raises(
        IdentificationError, match=r"joint joint, made: too little motion.*got 0 \(such motion lasts 0 s"
    ):
        build_samples([run_along(1e-4 * rng.standard_normal(4000))], rig_of(JOINT), "joint")
    with pytest.raises(IdentificationError, match="no stretch"):
        build_samples([run_along(np.zeros(30))], rig_of(JOINT), "joint")


def test_strokes_that_are_shorter_than_the_filter_window_are_refused_as_such():
    """The joint moves most of the time, but turns before a window has passed."""
    time = np.arange(4000) * 2e-3
    run = run_along(0.05 * np.sin(2 * np.pi * 5.0 * time))
    with pytest.raises(IdentificationError, match="too little motion") as caught:
        build_samples([run], rig_of(JOINT), "joint", width_s=0.08)
    said = str(caught.value)
    window = 1e-3 * float(said.partition("windows of ")[2].partition(" ms")[0])
    lasts = float(said.partition("lasts ")[2].partition(" s")[0])
    assert window > 0.1  # longer than the 0.1 s of a stroke
    assert lasts > 2.0  # of 8 s
    assert "at least 50" in said
    assert "\n" not in said


@pytest.mark.parametrize("still", ["training", "held-out"])
def test_a_refusal_says_which_runs_it_concerns(still):
    moves = record(replace(JOINT, torque_noise=0.1))
    rests = run_along(1e-4 * np.random.default_rng(0).standard_normal(8000))
    train, held = (moves, rests) if still == "held-out" else (rests, moves)
    with pytest.raises(IdentificationError, match=f"^{still} runs: joint joint, .*too little motion"):
        prepare_joint([train], [held], rig_of(JOINT), "joint")


@pytest.mark.parametrize(("zeros", "told"), [(0.85, True), (0.1, False)])
def test_a_report_that_is_silent_in_motion_is_told(zeros, told):
    run = run_along(0.5 * np.sin(3.0 * np.arange(4000) * 2e-3))
    current = np.where(np.random.default_rng(2).random(4000) < zeros, 0.0, run.columns["joint/current"] + 2.0)
    samples = build_samples(
        [replace(run, columns=dict(run.columns) | {"joint/current": current})], rig_of(JOINT), "joint"
    )
    silent = [note for note in samples.notes if isinstance(note, SilentEffort)]
    assert [(note.run, note.column) for note in silent] == [("made", "joint/current")] * told
    assert not told or 0.8 <= silent[0].share < 0.9


def test_one_run_does_not_reach_into_the_margins_of_the_next() -> None:
    """The kernels mix the runs where these meet; no filter that is computed later may see it."""
    near, far = record(JOINT, "near"), record(JOINT, "far", 1.0)
    moved = {"joint/current": far.columns["joint/current"] + 100.0}
    alone, both = (
        build_samples(runs, rig_of(JOINT), "joint", width_s=0.03, final_s=0.03)
        for runs in ([near], [near, replace(far, columns={**far.columns, **moved})])
    )
    assert_allclose(both.signals.effort[: alone.signals.effort.size], alone.signals.effort, rtol=1e-12, atol=1e-12)


def test_friction_is_known_a_kernel_away_from_a_reversal() -> None:
    samples = build_samples([record(JOINT)], rig_of(JOINT), "joint")
    near, turns = samples.light.margin, np.flatnonzero(np.diff(samples.moving.astype(int)))
    assert turns.size > 2 and 0.5 < samples.sliding.mean() < samples.moving.mean()
    for turn in turns:
        assert not samples.sliding[max(turn - near + 1, 0) : turn + near].any()
    assert not np.any(samples.sliding & ~samples.moving)
