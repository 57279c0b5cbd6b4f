"""Which experiment is asked for, by what is open."""

from dataclasses import replace

from drake_tc.diagnosis.residual.unexplained import (
    BeyondTraining,
    CoverRange,
    FindPeriodicSource,
    RepeatRun,
    RepeatUnchanged,
    TellApart,
    TimeStretch,
    Unexplained,
    VarySignals,
    next_experiment,
)

QUIET = Unexplained(1.0, 1.0, False, 0.0, 0.0, False, ())
STRUCTURED = replace(QUIET, structured=True, depends_on=("time", "velocity"))
STRETCH = TimeStretch("run_1", 2.0, 3.5)


def test_what_is_open_asks_for_an_experiment_effects_first():
    everything = replace(STRUCTURED, confined_to=(STRETCH,), period_hz=4.0)
    pairs = (("encoder_ripple", "delay"), ("delay", "encoder_ripple"))
    assert next_experiment(pairs, everything) == TellApart("encoder_ripple", "delay")
    assert next_experiment((), everything) == RepeatRun("run_1", 2.0, 3.5)
    line = replace(everything, confined_to=())
    assert next_experiment((), line) == FindPeriodicSource(4.0)
    assert next_experiment((), line, among_joints=True) == FindPeriodicSource(4.0, among_joints=True)
    assert next_experiment((), STRUCTURED) == VarySignals(("velocity",))
    assert next_experiment((), replace(STRUCTURED, depends_on=("time",))) == RepeatUnchanged()
    assert next_experiment((), QUIET) is None


def test_a_range_that_was_not_covered_comes_before_the_stretch_in_which_it_was_left():
    beyond = BeyondTraining("temperature", ("warm",), (24.0, 31.0), (24.0, 59.0), 0.99)
    assert next_experiment((), replace(STRUCTURED, confined_to=(STRETCH,), beyond=beyond)) == CoverRange(beyond)


def test_a_line_that_recorded_signals_explain_is_not_that_of_a_source_nearby():
    line = replace(STRUCTURED, period_hz=1.98, depends_on=("velocity", "time"))
    assert next_experiment((), replace(line, fraction=0.8)) == VarySignals(("velocity",))
    assert next_experiment((), replace(line, fraction=0.2)) == FindPeriodicSource(1.98)
    assert next_experiment((), replace(line, fraction=0.8, depends_on=("time",))) == FindPeriodicSource(1.98)
