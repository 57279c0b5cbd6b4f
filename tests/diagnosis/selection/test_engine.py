"""The search engine on a made-up problem: sets of letters with known errors."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest

from drake_tc.diagnosis.selection.engine import Proposal, select
from drake_tc.diagnosis.selection.withdrawal import DidNotHold, NoiseOfEffort
from drake_tc.diagnosis.thresholds import JOINT

PLAIN = replace(JOINT, least_log_evidence=-np.inf, least_removed=0.0, least_of_first=0.0)


@dataclass(frozen=True)
class Letters:
    """Every set of letters has an error; a set that is not listed has that of the best listed subset."""

    known: Mapping[str, float]
    impossible: str = ""
    several: str = ""
    special: tuple[str, str] = ("", "")  # general, special

    @property
    def floor(self):
        return np.zeros(1)

    def error(self, fit):
        return min(e for name, e in self.known.items() if set(name) <= set(fit))

    def errors(self, fit):
        return np.array([self.error(fit)])

    def effective(self, small, fit):
        return np.array([1000.0])

    def size(self, fit):
        return sum(3 if letter in self.several else 1 for letter in fit)

    def order(self, fit):
        return (self.size(fit), *map(ord, fit))

    def share(self, small, large):
        return 1.0

    def proposals(self, parent, known):
        for letter in "abcd":
            grown = "".join(sorted({*parent, letter}))
            if letter not in parent and grown not in known:
                yield Proposal(grown, self.error(grown), lambda grown=grown: grown)

    def is_possible(self, fit):
        return not set(fit) & set(self.impossible)

    def objections(self, fit):
        return [DidNotHold(x, x, x, NoiseOfEffort()) for x in fit if x in self.impossible]

    def without_each(self, large, small):
        for letter in set(large) - set(small):
            yield large.replace(letter, "")

    def contains(self, large, small):
        return (set(large) - set(small), set(small) - set(large)) == ({self.special[0]}, {self.special[1]})

    def adopted(self, fit):
        return fit


@pytest.mark.parametrize(
    ("errors", "chosen"),
    [
        ({"": 1.0}, ""),
        ({"": 1.0, "c": 0.5}, "c"),
        ({"": 1.0, "c": 0.5, "bc": 0.2}, "bc"),
        ({"": 1.0, "c": 0.96}, ""),  # gain below 5 %
        ({"": 1.0, "a": 0.7, "b": 0.8, "bd": 0.1}, "bd"),  # the best first step is no part of the best set
        ({"": 1.0, "a": 0.99, "ab": 0.5}, ""),  # nothing promises that a pair is worth looking for
        ({"": 1.0, "a": 0.97, "ab": 0.5}, "ab"),  # ... here it does: each hides the other
    ],
)
def test_the_set_with_the_least_error_that_is_worth_its_size_is_chosen(errors, chosen):
    assert select(Letters(errors), "", PLAIN).chosen == chosen


def test_of_sets_as_good_as_each_other_the_smallest_is_taken_and_the_others_are_told():
    found = select(Letters({"": 1.0, "a": 0.500, "b": 0.505, "c": 0.7}, several="a"), "", PLAIN)
    assert found.chosen == "b"
    assert found.as_good == (("a",),)
    assert found.alternatives == ("a", "c")  # d leaves twice the least error: not near


@pytest.mark.parametrize(("general", "chosen"), [(0.48, "a"), (0.40, "d")])
def test_an_effect_must_be_a_real_improvement_over_the_simpler_one_that_it_contains(general, chosen):
    errors = {"": 1.0, "a": 0.5, "d": general}
    assert select(Letters(errors, special=("d", "a")), "", PLAIN).chosen == chosen
    assert select(Letters(errors), "", PLAIN).chosen == "d"


def test_what_is_impossible_is_passed_over_and_told_only_if_it_would_have_been_taken():
    found = select(Letters({"": 1.0, "a": 0.3, "b": 0.5}, impossible="a"), "", PLAIN)
    assert (found.chosen, [d.key for d in found.passed_over]) == ("b", ["a"])
    found = select(Letters({"": 1.0, "a": 0.6, "b": 0.5}, impossible="a"), "", PLAIN)
    assert (found.chosen, found.passed_over) == ("b", ())
    found = select(Letters({"": 1.0, "a": 0.97}, impossible="a"), "", PLAIN)
    assert (found.chosen, found.passed_over) == ("", ())  # no real improvement: nothing to tell


def test_a_pair_of_which_one_alone_does_the_work_is_not_taken():
    errors = {"": 1.0, "a": 0.97, "ab": 0.93, "b": 0.965}
    assert select(Letters(errors), "", PLAIN).chosen == ""


def test_the_largest_number_of_effects_is_kept():
    errors = {"": 1.0, "a": 0.6, "ab": 0.3, "abc": 0.1, "abcd": 0.01}
    for most in range(4):
        assert select(Letters(errors), "", replace(PLAIN, most=most)).chosen == "abcd"[:most]


@pytest.mark.parametrize("impossible", ["", "a", "ab"])
def test_what_is_begun_beside_the_search_is_what_the_search_refines(impossible):
    begun, refined = [], []

    class Watched(Letters):
        def proposals(self, parent, known):
            for each in super().proposals(parent, known):

                def finished(each=each):
                    refined.append(each.key)
                    return each.refined()

                yield replace(each, refined=finished, begin=lambda each=each: begun.append(each.key))

    errors = {"": 1.0, "a": 0.3, "b": 0.31, "c": 0.35, "d": 0.9, "bc": 0.2}
    select(Watched(errors, impossible), "", replace(PLAIN, refined=2))
    assert begun and set(begun) <= set(refined), "a worker computed what nobody asked for"
    assert len(begun) == len(set(begun))
    assert begun[:2] == ["a", "b"], "the best proposals come first"
    assert ("c" in begun) == bool(impossible), "one more for each that cannot be"


@pytest.mark.parametrize(("when_refined", "chosen"), [(0.1, "b"), (0.6, "a"), (0.9, "a")])
def test_an_effect_that_a_coarse_grid_hides_behind_another_is_refined_too(when_refined, chosen):
    class Coarse(Letters):
        def proposals(self, parent, known):
            for each in super().proposals(parent, known):
                yield replace(each, error=0.65) if each.key == "b" else each

    found = select(Coarse({"": 1.0, "a": 0.4, "b": when_refined, "c": 0.7, "d": 0.7}), "", PLAIN)
    assert found.chosen == chosen
    assert ("b" in found.alternatives) == (0.1 < when_refined <= 0.6), "what stays far is no alternative"
