"""Commands that search for a few effects: for tests of what is done with a result, where a full search costs most."""

from collections.abc import Sequence
from dataclasses import fields
from functools import partial

import pytest

from drake_tc.diagnosis.evidence import Evidence
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.search import Found, find
from drake_tc.effects.base import Effect
from drake_tc.effects.library import effect
from drake_tc.experiments import fitted
from drake_tc.experiments.check.effects import joint_effects
from drake_tc.experiments.rehearsal import twin


def diagnoses_look_for(monkeypatch: pytest.MonkeyPatch, *keys: str) -> None:
    """From here on a diagnosis tries these effects alone, and leaves the residual unassessed."""
    few = DiagnosisOptions(effects=tuple(map(effect, keys)), assess_residual=False)
    defaults = tuple(getattr(few, each.name) for each in fields(few))
    monkeypatch.setattr(DiagnosisOptions.__init__, "__defaults__", defaults)


def experiments_fit(monkeypatch: pytest.MonkeyPatch, *ids: str) -> None:
    """From here on `check`, `design` and `rehearse` fit the logs with these effects, and judge all of them still."""

    def found(evidence: Evidence, effects: Sequence[Effect]) -> Found:
        return find(evidence, [each for each in effects if each.id in ids])

    monkeypatch.setattr(fitted, "find", found)


def twins_show(monkeypatch: pytest.MonkeyPatch, *keys: str) -> None:
    """From here on a twin is made from what its logs show of these effects."""
    monkeypatch.setattr(twin, "joint_effects", partial(joint_effects, effects=tuple(map(effect, keys))))
