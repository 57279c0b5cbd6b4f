"""Scenarios of robust TSID: what cannot be simulated, or would change nothing, is refused; spans, seeds, steps."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from drake_tc.errors import ParamsError
from drake_tc.loops.whole_body.drives import TorqueNoise
from drake_tc.loops.whole_body.references import SpanSpec, contact_source
from drake_tc.loops.whole_body.running import build_tsid, simulate_tsid
from drake_tc.registry import tsid_entry
from drake_tc.robot.fields import Mount
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.robust.scaled import TorqueError


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{torque_error: {hold: 1.0e-9}}", "torque_error.hold: expected plant_step 0.001 s or more, got 1e-09"),
        ("{ground: {margin: .nan}}", "ground.margin: expected a finite number, got nan"),
        ("{ground: {margin: 1.0}}", "ground.margin: expected a length from -0.1 to 0.1 \\[m\\], got 1"),
        ("{ground: {margin: -0.055}}", "ground.margin: expected more than -0.055 m, where nothing is left of contact"),
        ("{ground: {radius: 10.0}}", "ground.radius: expected a length above 0 and at most 0.1 \\[m\\], got 10"),
        ("{ground: {radius: .nan}}", "ground.radius: expected a finite number, got nan"),
        (
            "{plant_step: 7.0e-4}",
            "plant_step: expected the controller's period, 0.001 s, or a whole part of it, got 0.0007",
        ),
        ("{plant_step: 3.0e-3}", "plant_step: expected the controller's period, 0.001 s"),
        ("{plant_step: 2.0e-3, changes: {period: 0.005}}", "plant_step: expected the controller's period, 0.005 s"),
        ("{changes: {period: 0.0015}}", "plant_step: expected the controller's period, 0.0015 s"),
        ("{seed: 99999999999999999999, torque_error: {}}", r"seed: expected a whole number from 0 to 2\^64 - 1"),
        ("{seed: 18446744073709551616}", r"seed: expected a whole number from 0 to 2\^64 - 1"),
        ("{drives: {kp: 3.0}}", "drives: expected torque: drives beside it"),
        ("{sensors: perfect}", "sensors: expected state: estimated or torque: drives beside it"),
        ("{sensors: anything, state: estimated}", "sensors.*anything"),
        ("{motion: {5: {times: [0, 1]}, '5': {times: [0, 1]}}}", "motion: key '5' is given twice"),
    ],
)
def test_refused(text, message):
    with pytest.raises(ParamsError, match=message):
        build_tsid(tsid_entry().scenario("balance", text=text))


def test_the_largest_seed_and_steps_that_divide_the_period_run():
    text = "{duration: 0.01, plant_step: 5.0e-4, seed: 18446744073709551615, state: estimated, torque_error: {}}"
    recording = simulate_tsid(tsid_entry().scenario("balance", text=text))
    assert recording.time.size == 11
    assert np.isfinite(recording["estimated_state"]).all()
    with pytest.raises(ParamsError, match="expected a seed from 0 to"):
        TorqueNoise(TorqueError(np.ones(2)), 1e-3, seed=2**64)


@settings(max_examples=200, deadline=None)
@given(
    begin=st.floats(-0.01, 0.05),
    lasting=st.one_of(st.floats(1e-5, 0.05), st.just(np.inf)),
    period=st.sampled_from([1e-3, 1.5e-3, 5e-3]),
    ticks=st.booleans(),
)
@example(begin=1e-4, lasting=np.inf, period=1e-3, ticks=False)
@example(begin=0.0, lasting=2e-4, period=1e-3, ticks=False)
@example(begin=0.0101, lasting=1e-4, period=1e-3, ticks=False)
def test_contacts_are_lifted_at_the_ticks_of_their_spans(begin, lasting, period, ticks):
    """begin <= t < end at every tick, however near the edges are to the start, the end or each other."""
    if ticks:
        begin = period * round(begin / period)
        lasting = period * (1 + round(min(lasting, 0.05) / period))
    sole = Contact("sole", Mount("sole", "foot"), half_length=0.1, half_width=0.1)
    source = contact_source([sole], {"sole": (SpanSpec(begin, begin + lasting),)}, 0.03, period)
    context = source.CreateDefaultContext()
    for tick in range(round(0.03 / period) + 1):
        t = tick * period
        if min(abs(t - begin), abs(t - begin - lasting)) < 1e-5 * period and not ticks:
            continue
        late = 1e-9 * period if ticks else 0.0  # an edge at a tick is that tick's, whatever rounding says
        wanted = 0.0 if begin - late <= t < begin + lasting - late else 1.0
        for instant in (t, t * (1 + 1e-15), t * (1 - 1e-15)):
            context.SetTime(instant)
            assert source.get_output_port().Eval(context)[0] == wanted
