"""Pages beside the report, from templates: plain pages in its style, and RIG.md.

`plain_page` makes a self-contained page of headings, sentences, tables and plots. `rig_page` explains the rig file,
from the model of the file and from the effect library.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from drake_tc import __version__
from drake_tc.config.files import utf8_text
from drake_tc.config.joint_units import in_units_of
from drake_tc.config.keys import Keys
from drake_tc.config.page import key_table, table
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


EXAMPLES = ("joint_rig.yaml", "leg_rig.yaml", "leg_robot.yaml")
"""The complete examples in drake_tc/logs/examples."""


def rig_page() -> str:
    """The page as Markdown."""
    parts = {
        "top": key_table(RigDocument),
        "load_words": table(("`load:`", "meaning"), ((f"`{word}`", meaning) for word, meaning in WORDS.items())),
        "load_kinds": "\n\n".join(_load_kind(name) for name in KINDS),
        "columns": _column_table(),
        "effects": table(
            ("id", "effect", "parameters [unit]", "a declared value is"),
            ((f"`{name}`", effect(name).title, _parameters(effect(name)), _use(effect(name))) for name in EFFECT_IDS),
        ),
        "robot_causes": ", ".join(f"`{name}`" for name in ROBOT_CAUSES),
        "joint_sensors": key_table(JointSensorKeys),
        "torque_sensor": key_table(TorqueSensorKeys),
        "encoder": key_table(EncoderKeys),
        "current": key_table(CurrentKeys),
        "voltage": key_table(VoltageKeys),
        "torque_command": key_table(TorqueCommandKeys),
        "force_torque": key_table(ForceTorqueKeys),
        "imu": key_table(ImuKeys),
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
        return f"**`load: {{{name}: ...}}`**. {inner.__doc__}\n\n{key_table(inner)}"
    return f"**`load: {{{name}: ...}}`**. {kind.__doc__}\n\n{key_table(kind)}"


def _column_table() -> str:
    rows = [("`time`", COLUMN_MEANING["time"], *_units("time"))]
    rows += [(f"`<joint>/{suffix}`", COLUMN_MEANING[suffix], *_units(suffix)) for suffix in JOINT_SUFFIXES]
    rows += [("`<joint>/enabled`, `enabled`", COLUMN_MEANING["enabled"], "–", "–")]
    for suffix in (name for name in SENSOR_SUFFIXES if name.endswith("x")):
        prefix = "imu" if suffix.startswith(("gyro", "accel")) else "ft"
        axes = ", ".join(f"{suffix[:-1]}{axis}" for axis in "xyz")
        rows.append((f"`{prefix}_<sensor>/{{{axes}}}`", COLUMN_MEANING[suffix], *_units(suffix)))
    return table(("canonical column", "meaning", "SI unit", "units that may be declared"), rows)


def _units(suffix: str) -> tuple[str, str]:
    units = list(allowed_units(suffix))
    slides = in_units_of("prismatic", units[0])
    if suffix == "temperature":
        si = "°C"
    else:
        si = f"{units[0]} or {slides}" if suffix in JOINT_SUFFIXES and slides != units[0] else units[0]
    return si, ", ".join(f"`{unit}`" for unit in units)


def _parameters(member: Effect) -> str:
    listed = []
    for parameter in member.parameters:
        meaning = f" {parameter.description}" if parameter.description else ""
        listed.append(f"`{parameter.name}`{meaning} [{parameter.unit.replace('*', '·')}]")
    return ", ".join(listed)


def _use(member: Effect) -> str:
    """What a fit does with a declared value (`drake_tc.diagnosis.problem.declared`)."""
    held = member.id == "rotor_inertia" or (member.id not in ALWAYS and can_be_held(member.id))
    return "held" if held else "fitted anew"


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
