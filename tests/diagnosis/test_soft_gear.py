"""A gear that winds up and a torque sensor that reads too little scale the load alike: which one is searched for."""

from types import SimpleNamespace

import pytest

from drake_tc.diagnosis import searches as module
from drake_tc.effects.elasticity import Elasticity
from drake_tc.effects.torque_sensor_gain import TorqueSensorGain


def stage(chosen, as_good):
    def fitted(effect):
        return SimpleNamespace(terms=[SimpleNamespace(effect=effect)])

    found = SimpleNamespace(chosen=fitted(chosen), as_good=(tuple(map(fitted, as_good)),))
    return SimpleNamespace(found=found)


@pytest.mark.parametrize(
    ("chosen", "as_good", "searches"),
    [
        (TorqueSensorGain(), [Elasticity()], [frozenset(), frozenset({"torque_sensor_gain"})]),
        (TorqueSensorGain(), [], [frozenset()]),
        (Elasticity(), [TorqueSensorGain()], [frozenset()]),
    ],
)
def test_on_the_rows_of_a_soft_gear_elasticity_is_tried_alone_where_it_fits_as_well(
    monkeypatch, chosen, as_good, searches
):
    """The rows were chosen as a soft gear has them; where a gain is only as good there, it is left out."""
    asked = []

    def looked_for(prepared, options, progress, executor, without=frozenset()):
        asked.append(without)
        return stage(Elasticity() if without else chosen, as_good)

    monkeypatch.setattr(module, "searched", looked_for)
    result = module._on_soft_rows(None, None, None, None)
    assert asked == searches
    assert module._has(result.found, Elasticity) == (bool(searches[1:]) or isinstance(chosen, Elasticity))
