"""Pages beside the report, from templates: plain pages in its style, and RIG.md.

`plain_page` makes a self-contained page of headings, sentences, tables and plots. `rig_page` explains the rig file,
from the model of the file and from the effect library.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import get_args

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from drake_tc import __version__
from drake_tc.config.files import utf8_text
from drake_tc.config.joint_units import in_units_of
from drake_tc.config.keys import HIDDEN, Keys, default_of, unit_of
from drake_tc.config.page import flow_yaml, table
from drake_tc.diagnosis.problem.declared import ALWAYS, can_be_held
from drake_tc.effects.base import Effect
from drake_tc.effects.library import effect
from drake_tc.logs.loads import FORCE_TORQUE_PARTS, IMU_PARTS, Tolerance
from drake_tc.logs.rig_document.declared import EFFECT_IDS, ROBOT_CAUSES
from drake_tc.logs.rig_document.document import RigDocument
from drake_tc.logs.rig_document.loads import KINDS, WORDS
from drake_tc.logs.rig_document.sensors import (
    CurrentKeys,
    EncoderKeys,
    ForceTorqueKeys,
    ImuKeys,
    JointSensorKeys,
    TorqueCommandKeys,
    TorqueSensorKeys,
    VoltageKeys,
)
from drake_tc.logs.units import COLUMN_MEANING, JOINT_SUFFIXES, SENSOR_SUFFIXES, allowed_units


@dataclass(frozen=True)
class PageTable:
    """Rows of text under headings; columns named in `numbers` are set to the right."""

    headings: tuple[str, ...]
    rows: Sequence[Sequence[str]]
    numbers: tuple[str, ...] = ()


@dataclass(frozen=True)
class PageSection:
    """One section: warnings, sentences, plots (SVG elements), tables."""

    heading: str
    paragraphs: Sequence[str] = ()
    warnings: Sequence[str] = ()
    plots: Sequence[str] = ()
    tables: Sequence[PageTable] = ()
    aside: str = ""


def plain_page(title: str, kicker: str, lead: Sequence[str], sections: Sequence[PageSection]) -> str:
    """The HTML of a page that fetches nothing.

    Args:
        title: Of the page, and its first heading.
        kicker: The small line above it.
        lead: Sentences below it.
        sections: In order.
    """
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["svg"] = Markup
    folder = files("drake_tc.report")
    template = environment.from_string((folder / "plain_page.html.jinja").read_text(encoding="utf-8"))
    page = template.render(
        title=title,
        kicker=kicker,
        lead=list(lead),
        sections=list(sections),
        style=Markup((folder / "report.css").read_text(encoding="utf-8")),
        version=__version__,
    )
    return utf8_text(page)


EXAMPLES = ("joint_rig.yaml", "leg_rig.yaml")
"""The complete examples in drake_tc/logs/examples. The second one names a robot file, which stands beside it."""
JOINT_TOLERANCES = (TorqueSensorKeys, EncoderKeys, CurrentKeys, VoltageKeys, TorqueCommandKeys)
"""Mappings inside `JointSensorKeys`."""


def rig_page() -> str:
    """The page as Markdown."""
    parts = {
        "top": _key_table(RigDocument),
        "load_words": table(("`load:`", "meaning"), ((f"`{word}`", meaning) for word, meaning in WORDS.items())),
        "load_kinds": "\n\n".join(_load_kind(name) for name in KINDS),
        "columns": _column_table(),
        "held": _effect_table(held=True),
        "fitted": _effect_table(held=False),
        "robot_causes": ", ".join(f"`{name}`" for name in ROBOT_CAUSES),
        "joint_sensors": _key_table(JointSensorKeys),
        "force_torque": _key_table(ForceTorqueKeys),
        "imu": _key_table(ImuKeys),
        "parts": _part_table(),
        **{name.split(".")[0]: example(name).rstrip() for name in EXAMPLES},
    }
    text = (files("drake_tc.report") / "rig_page.md.jinja").read_text(encoding="utf-8")
    environment = Environment(undefined=StrictUndefined, autoescape=False, keep_trailing_newline=True)
    return environment.from_string(text).render(parts)


def example(name: str) -> str:
    """The text of one of the complete examples."""
    return (files("drake_tc.logs") / "examples" / name).read_text(encoding="utf-8")


def _load_kind(name: str) -> str:
    """What one kind of load with parameters says."""
    kind = KINDS[name]
    field = kind.model_fields[name]
    inner = field.annotation
    if isinstance(inner, type) and issubclass(inner, Keys):
        return f"**`load: {{{name}: ...}}`**. {inner.__doc__}\n\n{_key_table(inner)}"
    return f"**`load: {{{name}: ...}}`**. {kind.__doc__}\n\n{_key_table(kind)}"


def _key_table(model: type[Keys]) -> str:
    """One row for each key of a mapping: its example, meaning and default."""
    return table(("key, by an example [SI unit]", "meaning", "default"), _key_rows(model))


def _key_rows(model: type[Keys], form: str = "{}") -> Iterator[tuple[str, str, str]]:
    """Rows of a mapping; a mapping of sensors inside it has the rows of its keys, whose examples `form` puts inside."""
    for name, field in model.model_fields.items():
        shown = field.alias or name
        if shown.startswith(HIDDEN):
            continue
        inner = [kind for kind in get_args(field.annotation) if kind in JOINT_TOLERANCES]
        if inner:
            yield from _key_rows(inner[0], f"{shown}: {{{{{{}}}}}}")
            continue
        example = form.format(f"{shown}: {flow_yaml((field.examples or [None])[0])}")
        unit = f" [{unit_of(field)}]" if unit_of(field).strip("-–") else ""
        yield f"`{example}`{unit}", field.description or "", default_of(field)


def _column_table() -> str:
    names = {suffix: f"<joint>/{suffix}" for suffix in JOINT_SUFFIXES}
    for suffix in (name for name in SENSOR_SUFFIXES if name.endswith("x")):
        prefix = "imu" if suffix.startswith(("gyro", "accel")) else "ft"
        names[suffix] = f"{prefix}_<sensor>/{suffix[:-1]}{{x,y,z}}"
    rows = [("`time`", COLUMN_MEANING["time"], _units("time"))]
    first: dict[str, str] = {}
    for suffix, name in names.items():
        units = _units(suffix)
        same = first.setdefault(units, suffix)
        rows.append((f"`{name}`", COLUMN_MEANING[suffix], units if same == suffix else f"as `{same}`"))
    rows.append(("`<joint>/enabled`, `enabled`", COLUMN_MEANING["enabled"], "–"))
    return table(("canonical column", "meaning", "SI unit; others that `units` takes"), rows)


def _units(suffix: str) -> str:
    units = list(allowed_units(suffix))
    slides = in_units_of("prismatic", units[0])
    si = ["°C"] if suffix == "temperature" else [units[0]]
    if suffix in JOINT_SUFFIXES and slides != units[0]:
        si.append(slides)
    others = ", ".join(f"`{unit}`" for unit in units if unit not in si)
    return " or ".join(si) + (f"; {others}" if others else "")


def _effect_table(*, held: bool) -> str:
    """The effects whose declared values are held, or those whose values are fitted anew."""
    effects = ((name, effect(name)) for name in EFFECT_IDS)
    rows = ((f"`{name}`", f"{each.title}: {_parameters(each)}") for name, each in effects if _held(each) == held)
    return table(("id", "effect: parameters [unit]"), rows)


def _parameters(member: Effect) -> str:
    return ", ".join(f"`{each.name}` [{each.unit.replace('*', '·')}]" for each in member.parameters)


def _held(member: Effect) -> bool:
    """Whether a fit takes a declared value as it is (`drake_tc.diagnosis.problem.declared`)."""
    return member.id == "rotor_inertia" or (member.id not in ALWAYS and can_be_held(member.id))


def _part_table() -> str:
    rows = [
        ("`ft_`", f"`{name}`", f"{part.force_bias:.3g} N, {part.torque_bias:.3g} N·m", *_errors(part))
        for name, part in FORCE_TORQUE_PARTS.items()
    ]
    rows += [
        ("`imu_`", f"`{name}`", f"{part.accel_bias:.3g} m/s², {part.gyro_bias:.3g} rad/s", *_errors(part))
        for name, part in IMU_PARTS.items()
    ]
    return table(("sensor", "part", "bias", "gain", "alignment"), rows)


def _errors(part: Tolerance) -> tuple[str, str]:
    return f"{part.gain:.3g}", f"{part.alignment:.3g} rad"
