"""The final kernel of a log with a coarse encoder: a pendulum on a current drive, 12-bit encoder, 200 Hz."""

import numpy as np
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.data.resolution import final_widths
from drake_tc.diagnosis.data.sliding import choose_rows, covered
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.effects.library import effect
from drake_tc.filtering.common_kernel import CommonKernel

from ..coarse_pendulum import GAIN, LENGTH, MASS, RIG, ROTOR, STEP, pendulum
from ..rigs import Joint, record, rig_of


def estimate(final_s: float | None) -> tuple[float, dict[str, float], float]:
    """Drive gain, parameters and RMS of the residual [A]."""
    samples = build_samples([pendulum(0.0), pendulum(0.4)], RIG, "joint", final_s=final_s)
    terms = tuple(Term(effect(key)) for key in ("viscous", "coulomb", "rotor_inertia"))
    columns = Columns(samples)
    columns = columns.with_model(terms, fit(columns, terms).beta, servo=False)
    found = fit(columns, terms)
    values = dict(zip(("viscous", "coulomb", "rotor_inertia"), found.beta[1:], strict=True))
    return found.gain, values, float(np.sqrt(np.mean(found.residual**2)))


def test_a_coarse_encoder_does_not_bias_the_parameters():
    gain, values, rms = estimate(None)
    assert_allclose(gain, GAIN, rtol=3e-3)  # a third of a per cent: the encoder's steps in the load itself
    inertia = values["rotor_inertia"] + MASS * LENGTH**2
    assert_allclose(inertia, ROTOR + MASS * LENGTH**2, rtol=5e-3)
    narrow = estimate(0.06)
    assert rms < 0.5 * narrow[2]
    assert abs(gain / GAIN - 1.0) < abs(narrow[0] / GAIN - 1.0)


def test_the_widths_end_where_noise_is_small_or_at_their_limits():
    light = CommonKernel(0.06, 5e-3)
    run = pendulum(0.0)
    acceleration = light.second_derivative(run.columns["joint/position"])[100:-100]
    none, coarse, worst = (final_widths(acceleration, noise, light) for noise in (0.0, STEP / np.sqrt(12.0), 0.05))
    assert none == [light.actual_width_s]
    assert coarse == sorted(coarse)
    assert len(coarse) > 1
    assert_allclose(worst[-1], min(4.0 * light.actual_width_s, 0.25), rtol=1e-12)


def test_short_strokes_keep_the_narrow_kernel():
    """Strokes of 0.2 s: under 250 ms no sample would be left."""
    light, period = CommonKernel(0.02, 1e-3), 1e-3
    time = np.arange(20_000) * period
    moving = np.abs(np.sin(2.0 * np.pi * 2.5 * time)) > 0.2
    narrow, wide = (CommonKernel(width, period) for width in (0.02, 0.25))
    whole = [slice(0, time.size)]
    assert covered(moving, whole, wide, light) == 0
    rows, _ = choose_rows(moving, whole, narrow, light, period)
    assert covered(moving, whole, narrow, light) >= rows.size > 0


def test_a_balance_without_an_inertia_keeps_the_narrow_kernel():
    """The torque is measured, and only with a rotor inertia does the noise of the acceleration enter the balance."""
    inertial, free = (
        build_samples([record(joint)], rig_of(joint), "joint")
        for joint in (Joint(encoder_step=STEP, period=5e-3, inertia=size) for size in (0.3, 0.0))
    )
    assert_allclose(free.kernel.width_s, free.light.actual_width_s, rtol=1e-12)
    assert inertial.kernel.width_s > 1.2 * free.kernel.width_s
