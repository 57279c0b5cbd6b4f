"""An experiment with known loads as files: a trajectory for each load, what the rig file says of them, and a page."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import yaml

from drake_tc.experiments.design.load_design import BEYOND, LoadDesign, LoadRun
from drake_tc.experiments.design.loads import MOST_LOADS, declaring, hang_angle
from drake_tc.experiments.design.output import (
    design_document,
    expected_table,
    motion_plot,
    start_text,
    write_told,
    write_trajectory,
)
from drake_tc.logs.rig import rig_document
from drake_tc.report.pages import PageSection, PageTable, plain_page

RIG_LINES = "rig_load.yaml"
LOAD_FILES = (
    *(f"trajectory_{n + 1}{end}" for n in range(MOST_LOADS) for end in (".csv", ".yaml", ".drake.yaml")),
    RIG_LINES,
)
"""Files that an experiment with known loads may have beside `output.FILES`."""


def write_load_design(design: LoadDesign, folder: Path, rate_hz: float) -> None:
    """Write every file of an experiment with known loads."""
    write_told(folder, load_json(design), load_page(design))
    joint = design.joint.name
    for number, (name, run) in enumerate(_named(design)):
        time, motion = run.design.motion(rate_hz)
        load = {f"{joint}/load_mass": run.load.mass, f"{joint}/load_arm": run.load.arm}
        write_trajectory(folder, name, time, {joint: motion}, load)
        if number == 0:
            write_trajectory(folder, "trajectory", time, {joint: motion})
    lines = rig_lines(design)
    if lines:
        (folder / RIG_LINES).write_text(lines, encoding="utf-8")


def rig_entry(design: LoadDesign) -> Any:
    """What the rig file says under `load`, with the masses of the new logs; None where it stays as it is."""
    rig, joint = design.joint.rig, design.joint.name
    if rig is not None:
        rig = declaring(rig, joint, [(f"{name}*", run.load) for name, run in _named(design)])
    return None if rig is None else rig_document(rig)["load"]


def rig_lines(design: LoadDesign) -> str:
    """The same as text; empty where the rig file stays as it is."""
    entry = rig_entry(design)
    if entry is None:
        return ""
    text = str(yaml.safe_dump(entry, sort_keys=False, allow_unicode=True, default_flow_style=True, width=10**9))
    return f"# Replaces the key `load` of the rig file; the first pattern that fits a log counts.\nload: {text}"


def _named(design: LoadDesign) -> list[tuple[str, LoadRun]]:
    return [(f"trajectory_{number + 1}", run) for number, run in enumerate(design.runs)]


def load_json(design: LoadDesign) -> dict[str, Any]:
    """The experiment as plain data."""
    runs = [
        {
            "file": f"{name}.csv",
            "mass": run.load.mass,
            "arm": run.load.arm,
            "seconds": run.seconds,
            "period": run.design.basis.period,
            "repeats": run.design.repeats,
            "parameters": [float(x) for x in run.design.x],
            "largest_load_torque": _largest(run),
            "gain_lost_without": run.worth,
        }
        for name, run in _named(design)
    ]
    rig = rig_entry(design)
    entry = {
        "goal": design.goal.text,
        "limits": asdict(design.runs[0].design.limits),
        "basis": design.runs[0].design.basis.kind,
        "runs": runs,
        "loads": {
            "given": [asdict(load) for load in design.loads],
            "gain": design.gain,
            "without_loads": design.refusal,
        },
        "expected": [asdict(each) for each in design.expected],
        "expected_without_loads": [asdict(each) for each in design.without],
        "sentences": [*design.sentences, *_how(design)],
        "rig": {} if rig is None else {"load": rig},
    }
    return design_document({"joints": {design.joint.name: entry}})


def _how(design: LoadDesign) -> tuple[str, ...]:
    """How the logs are recorded and what the rig file says of them."""
    logs = "; ".join(f"{name}.csv with {run.load.words}" for name, run in _named(design))
    parts = [f"Record one log for each load: {logs}."]
    angles = {hang_angle(design.joint, run.load) for run in design.runs if run.load.arm}
    if angles:
        where = " or ".join(f"{angle:.3g} rad" for angle in sorted(angles))
        parts.append(
            f"The design assumes that an added mass hangs straight down at the position {where}. If it does not, "
            "give the position [rad] as MASS@ARM@ANGLE."
        )
    if rig_entry(design) is None:
        parts.append("The rig file stays as it is: the torque column of each log contains its load.")
    else:
        parts.append(
            f"Name each log as its trajectory, and put the lines of {RIG_LINES} into the rig file in place of the "
            "key load."
        )
    if len(design.runs) == 1:
        parts.append("Give the new log as --log and an earlier one as --holdout.")
    else:
        parts.append(
            "Give all the new logs as --log and an earlier one as --holdout: each of them alone does not tell what "
            "all of them together do."
        )
    return tuple(parts)


def load_lines(design: LoadDesign) -> list[str]:
    """The same as lines of text for a console."""
    out = [f"{design.joint.name}: goal {design.goal.text}"]
    out += [f"  {sentence}" for sentence in (*design.sentences, *_how(design))]
    out += [f"  {name}: {', '.join(words[:3])}" for name, *words in _run_rows(design)]
    return out + [f"  {line}" for line in rig_lines(design).splitlines()]


def _run_rows(design: LoadDesign) -> list[tuple[str, str, str, str, str]]:
    torque = design.runs[0].design.limits.units.text("N m")
    return [
        (
            f"{name}.csv",
            run.load.words,
            f"{run.seconds:.3g} s",
            f"{_largest(run):.3g} {torque} at rest",
            "–" if run.worth > BEYOND else f"{run.worth:.3g}",
        )
        for name, run in _named(design)
    ]


def load_page(design: LoadDesign) -> str:
    """The page: the loads, what they are good for, and the motion under each."""
    unloaded = {e.name: e.after for e in design.without}
    columns = {
        "logs so far": [e.before for e in design.expected],
        "growing sinusoid": [e.default for e in design.expected],
        "best motion without loads": [unloaded.get(e.name, float("nan")) for e in design.expected],
        "with known loads": [e.after for e in design.expected],
    }
    loads = PageTable(("log", "load", "length", "load torque", "gain lost without this log"), _run_rows(design), ())
    lines = rig_lines(design)
    tables = [expected_table(design.expected, columns), loads]
    if lines:
        tables.append(PageTable((f"rig file ({RIG_LINES})",), [(line,) for line in lines.splitlines()]))
    sections = [
        PageSection(
            design.joint.name, (*design.sentences, *_how(design)), tables=tables, aside=f"goal {design.goal.text}"
        )
    ]
    sections += [
        PageSection(
            f"{name}.csv: {run.load.words}",
            (start_text(run.design),),
            plots=(motion_plot(run.design, f"m{number}"),),
        )
        for number, (name, run) in enumerate(_named(design))
    ]
    return plain_page("The next experiment", "design", (), sections)


def _largest(run: LoadRun) -> float:
    """Largest load torque at rest [N m]."""
    return run.design.joint.largest_load(*run.design.limits.position)
