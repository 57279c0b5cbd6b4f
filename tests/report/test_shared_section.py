"""The section on causes that several joints share: there when there are some, and what it says."""

from dataclasses import replace

import pytest

from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.result.rig_result import CloseLoopResult, SharedEffect
from drake_tc.report.html import render
from drake_tc.report.numbers import percent
from drake_tc.report.report_json import result_json
from drake_tc.report.sections import shared_section


@pytest.fixture(scope="module")
def cause() -> SharedEffect:
    return SharedEffect(
        id="link_mass",
        where="thigh",
        title="mass of a link",
        parameters={"mass": Estimate(0.812, "kg", (0.79, 0.834), False)},
        heldout_gain=0.53,
        stability=0.99,
        joints={"knee": 0.71},
        indistinguishable=(("link_com", "thigh"),),
    )


def test_nothing_is_said_where_nothing_is_shared(result: CloseLoopResult):
    assert list(shared_section(result)) == []
    assert result_json(result)["shared"] == []


def test_the_section_names_cause_place_size_and_rival(result: CloseLoopResult, cause: SharedEffect):
    html = render(replace(result, shared=(cause,)))
    section = html[html.index('id="shared"') : html.index("</section>", html.index('id="shared"'))]
    shares = (percent(0.53), percent(0.71))
    for text in ("mass of a link", "thigh", "0.812", "kg", *shares, "centre of mass of a link (thigh)"):
        assert text in section, text
    assert 'href="#shared"' in html


def test_report_json_follows_the_contract(result: CloseLoopResult, cause: SharedEffect):
    (entry,) = result_json(replace(result, shared=(cause,)))["shared"]
    assert (entry["id"], entry["where"], entry["heldout_gain"]) == ("link_mass", "thigh", 0.53)
    assert entry["parameters"]["mass"] == {"value": 0.812, "unit": "kg", "ci95": [0.79, 0.834], "at_bound": False}
    assert entry["indistinguishable"] == [{"id": "link_com", "where": "thigh"}]


def test_a_late_encoder_is_not_explained_as_a_delay_of_all_drives(result: CloseLoopResult, cause: SharedEffect):
    late = Estimate(0.02, "s", (0.019, 0.021), at_bound=False)
    joint = next(iter(result.joints))
    for where, words in ((joint, "the delay of the encoder's readings"), ("all joints", "of every drive")):
        delay = replace(cause, id="delay", where=where, parameters={"delay": late}, indistinguishable=())
        (card,) = shared_section(replace(result, shared=(delay,)))
        assert words in card.meaning
