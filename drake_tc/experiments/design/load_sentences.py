"""What known loads bring to an experiment, in sentences."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.experiments.design.criteria import AllEffects, Criterion, Parameters
from drake_tc.experiments.design.discrimination import Discrimination
from drake_tc.experiments.design.expected import Expected
from drake_tc.experiments.design.known_loads import KnownLoad

BEYOND = 1e4
"""Gain beyond which there is nothing to compare with."""


@dataclass(frozen=True)
class Better:
    """How a goal is told to be better reached: a larger distance, or smaller errors."""

    quantity: str
    larger: bool

    @property
    def word(self) -> str:
        """Of a better value."""
        return "larger" if self.larger else "smaller"

    @property
    def opposite(self) -> str:
        """Of a worse value."""
        return "smaller" if self.larger else "larger"

    def ratio(self, after: float, without: float) -> float:
        """By which factor a quantity is better than without loads."""
        above, below = (after, without) if self.larger else (without, after)
        return above / below if below > 0.0 else np.nan


BETTER: Mapping[type[Criterion], Better] = {
    Discrimination: Better("the smallest distance", larger=True),
    Parameters: Better("the standard error (geometric mean)", larger=False),
    AllEffects: Better("the smallest size that is found (geometric mean)", larger=False),
}


def gain_sentences(
    criterion: Criterion,
    refusal: str,
    gain: float,
    worths: Sequence[tuple[KnownLoad, float]],
    expected: Sequence[Expected],
    without: Sequence[Expected],
) -> tuple[str, ...]:
    """What the loads bring over the best motion without them, and which of them brings most.

    Args:
        criterion: Of the goal.
        refusal: Why no motion without loads reaches the goal; empty where one does.
        gain: Factor over the best motion without loads.
        worths: Each load that takes part, and the factor that is lost without its log.
        expected: What the experiment is worth.
        without: What the best motion without loads is worth.
    """
    better = BETTER[type(criterion)]
    if refusal:
        texts = [f"Without known loads the goal is out of reach: {refusal}."]
    elif gain > BEYOND:
        texts = ["Without known loads no motion reaches the goal."]
    else:
        texts = [f"With the known loads {better.quantity} is {gain:.3g} times {better.word} than without loads."]
    best, worth = max((each for each in worths if each[0].mass), key=lambda each: each[1])
    if len(worths) == 1:
        texts.append(f"The whole experiment is under one load: {best.words}.")
    else:
        lost = "the goal would be out of reach"
        if worth < BEYOND:
            lost = f"{better.quantity} would be {worth:.3g} times {better.opposite}"
        texts.append(f"The load that brings most is {best.words}: without its log {lost}.")
    alone = {each.name: each.after for each in without}
    ratios = {each.name: better.ratio(each.after, alone.get(each.name, np.nan)) for each in expected}
    ratios = {name: r for name, r in ratios.items() if np.isfinite(r) and not name.startswith("probability")}
    if ratios:
        name = max(ratios, key=lambda each: ratios[each])
        texts.append(f"The loads change this quantity most: {name}, {ratios[name]:.3g} times {better.word}.")
    return tuple(texts)
