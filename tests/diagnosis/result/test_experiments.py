"""Which experiment is asked for, by what is open."""

from dataclasses import replace

from drake_tc.diagnosis.residual.unexplained import TimeStretch, Unexplained
from drake_tc.diagnosis.result.experiments import (
    CheckLoad,
    FindPeriodicSource,
    RepeatRun,
    RepeatUnchanged,
    SeparateLoads,
    TellApart,
    VarySignals,
    next_experiment,
)

QUIET = Unexplained(1.0, 1.0, False, 0.0, 0.0, False, ())
STRUCTURED = replace(QUIET, structured=True, depends_on=("time", "velocity"))
STRETCH = TimeStretch("run_1", 2.0, 3.5)


def test_what_is_open_asks_for_an_experiment_effects_first():
    everything = replace(STRUCTURED, confined_to=(STRETCH,), period_hz=4.0)
    pairs = (("encoder_ripple", "delay"), ("delay", "encoder_ripple"))
    assert next_experiment(pairs, everything, ["looks_like_known_load"]) == TellApart("encoder_ripple", "delay")
    assert next_experiment((), everything, ["implausible", "looks_like_known_load"]) == CheckLoad()
    assert next_experiment((), everything, loads_differ=True) == SeparateLoads()
    assert next_experiment((), everything) == RepeatRun("run_1", 2.0, 3.5)
    assert next_experiment((), replace(everything, confined_to=())) == FindPeriodicSource(4.0)
    assert next_experiment((), STRUCTURED) == VarySignals(("velocity",))
    assert next_experiment((), replace(STRUCTURED, depends_on=("time",))) == RepeatUnchanged()
    assert next_experiment((), QUIET) is None
