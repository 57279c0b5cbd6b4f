"""The next experiment is known for every effect that can be tied with another one."""

from drake_tc.diagnosis.residual.unexplained import Unexplained
from drake_tc.diagnosis.result.experiments import ISOLATES, next_experiment
from drake_tc.effects.library import LIBRARY, MULTI_JOINT


def test_every_effect_of_the_library_has_an_experiment_that_shows_it_alone():
    declared = {"viscous", "coulomb"}  # always part of the model, so never tied with another effect
    assert {effect.id for effect in (*LIBRARY, *MULTI_JOINT)} - declared <= set(ISOLATES)


def test_a_tie_with_any_effect_has_a_sentence():
    text = next_experiment([("encoder_ripple", "delay")], Unexplained(1.0, 1.0, False, 0.0, 0.0, False, ()), ())
    assert text.startswith("To tell encoder_ripple from delay: ")
