"""Every parameter that a model file or a page shows says what it is."""

import pytest

from drake_tc.effects.library import BUILT_IN


@pytest.mark.parametrize("effect", BUILT_IN, ids=lambda effect: effect.key)
def test_a_parameter_has_a_meaning(effect):
    without = [p.name for p in effect.parameters if len(p.description) < 3]
    assert without == []
