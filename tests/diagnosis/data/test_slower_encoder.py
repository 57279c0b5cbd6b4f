"""An encoder on a slower clock than the log's: the noise floor is what its noise leaves, not a part of it."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.effects.library import effect
from drake_tc.logs.record import Run

from ..rigs import Joint, motion, record, rig_of

JOINT = Joint(duration=40.0, inertia=3.0)
DECLARED = (Term(effect("viscous")), Term(effect("coulomb")))


def logged(spacing: float, noise: float, step: float, seed: int) -> Run:
    """A run whose encoder is read every `spacing` samples and interpolated between."""
    run = record(JOINT)
    own = np.arange(0.0, JOINT.duration + 1.0, spacing * JOINT.period)
    position = motion(replace(JOINT, duration=own[-1] + JOINT.period)).q
    exact = np.interp(own, np.arange(position.size) * JOINT.period, position)
    read = replace(JOINT, encoder_noise=noise, encoder_step=step).encoder(exact, np.random.default_rng(seed))
    columns = {**run.columns, "joint/position": np.interp(run.time, own, read)}
    return replace(run, columns=columns, slower={"joint/position": spacing * JOINT.period})


def left_over_floor(runs: list[Run]) -> tuple[float, Samples]:
    samples = build_samples(runs, rig_of(JOINT), "joint")
    columns = Columns(samples)
    fitted = fit(columns, DECLARED)
    return fitted.rms / (fitted.gain * samples.floor.torque(float(fitted.beta[0]), float(fitted.beta[1]))), samples


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(("noise", "step"), [(2e-4, 0.0), (2e-4, 2e-4)])
@pytest.mark.parametrize("spacing", [2.0, 10.0 / 3.0, 5.0])
def test_the_floor_is_what_the_noise_of_the_encoder_leaves(
    spacing: float, noise: float, step: float, seed: int
) -> None:
    """The joint has no torque noise, so that all that is left passes the inertia."""
    run = logged(spacing, noise, step, seed)
    ratio, samples = left_over_floor([run])
    assert ratio == pytest.approx(1.0, abs=0.25)  # the interpolation takes a part of the band's upper end
    assert samples.resolution.position_noise == pytest.approx(
        np.sqrt(spacing) * np.hypot(noise, step / np.sqrt(12.0)), rel=0.1
    )
    if spacing == 5.0 and not step:
        as_if_fast, _ = left_over_floor([replace(run, slower={})])
        assert as_if_fast > 3.0
