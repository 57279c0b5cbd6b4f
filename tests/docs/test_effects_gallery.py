"""The gallery of effects: each effect stands on the page of its group, with equation, look-alikes and experiment."""

import re

import pytest

from drake_tc.effects.base import Effect
from drake_tc.effects.library import BUILT_IN

from .conftest import DOCS  # noqa: F401 - puts docs/ on the path

effects = pytest.importorskip("site_pages.effects")
PAGES = effects.pages()
GALLERIES = {kind: PAGES[f"effects/{name}.md"] for kind, (name, _, _) in effects.GROUPS.items()}
ANCHOR = re.compile(r'^## .* \{ id="([^"]+)" \}$', re.M)


def section(effect: Effect) -> str:
    anchor = effect.key.replace(".", "-")
    _, found = GALLERIES[effect.kind].split(f'{{ id="{anchor}" }}')
    return found.split("\n## ")[0]


def test_every_cause_of_the_library_is_shown_once():
    shown = [anchor.split("-")[0] for text in GALLERIES.values() for anchor in ANCHOR.findall(text)]
    assert set(shown) == {effect.id for effect in BUILT_IN}
    anchors = [anchor for text in GALLERIES.values() for anchor in ANCHOR.findall(text)]
    assert len(anchors) == len(set(anchors))


@pytest.mark.parametrize("key", ["stribeck", "deadzone", "backlash", "payload", "torque_sensor_bias"])
def test_a_section_has_equation_plot_neighbours_and_experiment(key):
    (effect,) = (each for each in BUILT_IN if each.key == key)
    text = section(effect)
    assert text.count("<math") == effect.equation.count(";") + 1
    assert "<svg" in text and effect.signature.look_for in text
    assert "**Told apart:** vary" not in text  # an instruction of its own
    assert "**Taken for:**" in text


def test_what_imitates_is_another_cause():
    """A constant load is the same torque as a bias of the torque sensor's reading."""
    (bias,) = (each for each in BUILT_IN if each.key == "torque_sensor_bias")
    line = next(line for line in section(bias).splitlines() if "Taken for" in line)
    assert "sensor.md#torque_sensor_bias" not in line and "asymmetric_friction" in line


def test_every_link_of_the_galleries_has_its_section():
    anchors = {name: set(ANCHOR.findall(GALLERIES[kind])) for kind, (name, _, _) in effects.GROUPS.items()}
    links = re.findall(r"\]\((\w+)\.md#([\w-]+)\)", "".join(GALLERIES.values()))
    assert links and [link for link in links if link[1] not in anchors[link[0]]] == []
