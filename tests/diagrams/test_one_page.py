"""The whole loop on one page: the effect that was hidden is found, and the torque loop and MuJoCo get it."""

import io
import re
from contextlib import redirect_stdout

import pytest
from few_effects import diagnoses_look_for

from drake_tc.diagrams import one_page

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def printed() -> str:
    """What it prints where its diagnosis looks for four effects."""
    out = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out):
        diagnoses_look_for(patch, "stribeck", "deadzone", "delay", "torque_ripple")
        one_page.main()
    return out.getvalue()


def test_the_hidden_effect_is_found_and_nothing_else(printed):
    assert re.findall(r"^  \+ (\S+)", printed, re.MULTILINE) == ["stribeck"]
    assert "(effects_found)" in printed
    low, high = map(float, re.search(r"stribeck_velocity \S+ \[(\S+), (\S+)\]", printed).groups())
    assert low < 0.15 < high


def test_the_torque_loop_follows_much_better_with_it(printed):
    before, after = (float(re.search(rf"model {name}: (\S+) mrad", printed)[1]) for name in ("before", "after"))
    assert after < 0.2 * before


def test_mujoco_reads_the_joint(printed):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(printed[printed.index("<?xml") :])
    assert model.joint("knee").armature[0] == pytest.approx(0.3, rel=1e-6)
