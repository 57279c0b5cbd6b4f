"""Whole-body control of a humanoid two of whose joints follow others by `<mimic>`."""

import re
from pathlib import Path

import numpy as np
import pytest
from sweeps import slow_but

from drake_tc.loops.whole_body.running import build_tsid, simulate_tsid
from drake_tc.registry import tsid_entry

MODELS = Path(__file__).parents[3] / "models" / "hrp2_like"
FOLLOWS = {"l_wrist_pitch": ("l_elbow", -0.5), "r_gripper": ("r_elbow", 0.4)}


@pytest.fixture(scope="module")
def law(tmp_path_factory):
    """The file of a controller whose robot has followers."""
    folder = tmp_path_factory.mktemp("followers")
    text = (MODELS / "hrp2_like.urdf").read_text(encoding="utf-8")
    for name, (of, multiplier) in FOLLOWS.items():
        tag = f'<joint name="{name}" type="revolute">'
        assert tag in text
        text = text.replace(tag, f'{tag}<mimic joint="{of}" multiplier="{multiplier}"/>')
    (folder / "hrp2_like.urdf").write_text(text, encoding="utf-8")
    for name in ("hrp2_like.yaml", "hrp2_like_tsid.yaml", "hrp2_like_actuators.yaml"):
        document = (MODELS / name).read_text(encoding="utf-8")
        if name == "hrp2_like.yaml":
            for follower in FOLLOWS:
                document = re.sub(rf"{follower}(, |,\s|(?=\]))", "", document)
            document = re.sub(r",\s*\]", "]", document)
        (folder / name).write_text(document, encoding="utf-8")
    return folder / "hrp2_like_tsid.yaml"


@pytest.mark.parametrize("scenario", slow_but(("balance", "whole_chain"), "balance"))
def test_a_humanoid_with_followers_stands_as_one_without(law, scenario):
    found = {}
    for name, text in (("followers", f"{{duration: 0.4, controller: {law}}}"), ("none", "{duration: 0.4}")):
        found[name] = simulate_tsid(tsid_entry().scenario(scenario, text=text))
        assert np.isfinite(found[name]["torque"]).all()
    base = [recording["state"][:, :7] for recording in found.values()]
    assert np.abs(base[0] - base[1]).max() < 2e-3
    model = build_tsid(tsid_entry().scenario(scenario, text=f"{{controller: {law}}}")).law.model
    assert found["followers"]["state"].shape[1] == model.nq + model.nv == 7 + 6 + 2 * model.n
