"""A designed experiment as files: CSV at a rate, a ROS JointTrajectory, a Drake trajectory, JSON and a page.

A designed motion as a Drake trajectory: a `PiecewisePolynomial` in the YAML that Drake reads and writes.

    from pydrake.common.yaml import yaml_load_typed
    from pydrake.trajectories import PiecewisePolynomial
    trajectory = yaml_load_typed(schema=PiecewisePolynomial, filename="trajectory.drake.yaml")

Rows are the joints in the order of the other files.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from scipy.interpolate import BPoly, PPoly

from drake_tc.config.quoted import json_value
from drake_tc.experiments.design.criteria import Expected
from drake_tc.experiments.design.motions import JointLimits
from drake_tc.experiments.design.robot import RobotDesign
from drake_tc.experiments.design.run import JointDesign
from drake_tc.report.numbers import pretty_unit, significant
from drake_tc.report.pages import PageSection, PageTable, plain_page
from drake_tc.report.plots.svg import BACKWARD, FORWARD, new_figure, page_style, to_svg
from drake_tc.types import FloatArray

FILES = ("trajectory.csv", "trajectory.yaml", "trajectory.drake.yaml", "design.json", "design.html")
MOST_POINTS = 4000
"""Points of a ROS trajectory; a controller interpolates between them."""


def write_design(designs: Mapping[str, JointDesign], folder: Path, rate_hz: float) -> None:
    """Write every file of an experiment of one joint or of several that move together."""
    made = {joint: design.motion(rate_hz) for joint, design in designs.items()}
    time = next(iter(made.values()))[0]
    write_trajectory(folder, "trajectory", time, {joint: motion for joint, (_, motion) in made.items()})
    write_told(folder, design_json(designs), design_page(designs))


def write_trajectory(
    folder: Path, stem: str, time: FloatArray, motions: Mapping[str, FloatArray], columns: Mapping[str, float] = {}
) -> None:
    """Write a motion as CSV, ROS `JointTrajectory` and Drake trajectory.

    Args:
        folder: For the files.
        stem: Of their names.
        time: (T,) [s].
        motions: By joint, (4, T) position, velocity, acceleration and jerk.
        columns: More columns of the CSV, by name.
    """
    table = trajectory_table(time, motions)
    for name, value in columns.items():
        table[name] = value
    table.to_csv(folder / f"{stem}.csv", index=False)
    (folder / f"{stem}.yaml").write_text(joint_trajectory(time, motions), encoding="utf-8")
    (folder / f"{stem}.drake.yaml").write_text(drake_trajectory(time, motions), encoding="utf-8")


def write_told(folder: Path, document: Mapping[str, Any], page: str) -> None:
    """Write what a design is, for programs and for people."""
    (folder / FILES[3]).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    (folder / FILES[4]).write_text(page, encoding="utf-8")


def trajectory_table(time: FloatArray, motions: Mapping[str, FloatArray]) -> pd.DataFrame:
    """Columns `time`, `<joint>/position_command`, `/velocity_command`, `/acceleration_command` in SI units."""
    table: dict[str, FloatArray] = {"time": np.round(time, 9)}
    for joint, motion in motions.items():
        for row, name in enumerate(("position_command", "velocity_command", "acceleration_command")):
            table[f"{joint}/{name}"] = np.round(motion[row], 9)
    return pd.DataFrame(table)


def joint_trajectory(time: FloatArray, motions: Mapping[str, FloatArray]) -> str:
    """A trajectory_msgs/JointTrajectory as YAML, as `ros2 topic pub` reads it."""
    every = max(1, -(-time.size // MOST_POINTS))
    picked = np.unique(np.append(np.arange(0, time.size, every), time.size - 1))
    points = []
    for k in picked:
        seconds = int(time[k] + 1e-9)
        rows = [[round(float(m[row, k]), 9) for m in motions.values()] for row in range(3)]
        points.append(
            {
                "positions": rows[0],
                "velocities": rows[1],
                "accelerations": rows[2],
                "time_from_start": {"sec": seconds, "nanosec": round((float(time[k]) - seconds) * 1e9)},
            }
        )
    document = {"joint_names": list(motions), "points": points}
    return str(yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=10**9))


def design_json(designs: Mapping[str, JointDesign]) -> dict[str, Any]:
    """The whole design as plain data."""
    return design_document({"joints": {name: _joint_json(each) for name, each in designs.items()}})


def design_document(content: Mapping[str, Any]) -> dict[str, Any]:
    """What design.json has in every design, and the content of this one."""
    made: dict[str, Any] = json_value({"name": "design", "schema": 1, **content})
    return made


def write_robot_design(design: RobotDesign, folder: Path, rate_hz: float) -> None:
    """Write every file of an experiment of a whole robot."""
    write_trajectory(folder, "trajectory", *design.motion(rate_hz))
    write_told(folder, robot_json(design), robot_page(design))


def robot_json(design: RobotDesign) -> dict[str, Any]:
    """The design of a whole robot as plain data."""
    robot = {
        "joints": list(design.joints),
        "limits": {name: asdict(each) for name, each in zip(design.joints, design.limits, strict=True)},
        "period": design.bases[0].period,
        "repeats": design.repeats,
        "parameters": design.x.tolist(),
        "criterion": {"random": design.start_value, "designed": design.value},
        "collision_pairs": design.pairs,
        "least_distance": design.distance,
        "expected": [asdict(each) for each in design.expected],
        "sentences": list(design.sentences),
    }
    return design_document({"goal": "parameters", "robot": robot})


def robot_page(design: RobotDesign) -> str:
    """The page of a whole robot."""
    headings = ("quantity", "growing sinusoids", "designed motion")
    table = PageTable(
        headings, [(e.name, number_text(e.default), number_text(e.after)) for e in design.expected], headings[1:]
    )
    distance = (
        (f"{design.pairs} pairs of collision shapes keep a distance of {design.distance:g} m.",) if design.pairs else ()
    )
    plots = [
        _plot_of(design.best[:, :, i], design.bases[0].step, limits, name, f"m{i}")
        for i, (name, limits) in enumerate(zip(design.joints, design.limits, strict=True))
    ]
    section = PageSection("All joints", (*design.sentences, *distance), plots=plots, tables=(table,), aside="SI units")
    return plain_page("The next experiment", "design", (), (section,))


def _joint_json(design: JointDesign) -> dict[str, Any]:
    plan = design.plan
    return {
        "goal": design.goal.text,
        "limits": asdict(design.limits),
        "basis": design.basis.kind,
        "period": design.basis.period,
        "repeats": design.repeats,
        "parameters": [float(x) for x in design.x],
        "criterion": {"random": plan.start_value, "designed": plan.value},
        "solver": {"name": "random search", "starts": plan.starts},
        "expected": [asdict(each) for each in design.expected],
        "sentences": list(design.sentences),
    }


def design_page(designs: Mapping[str, JointDesign]) -> str:
    """The page: the motion, and what it is expected to bring."""
    sections = []
    for number, (name, design) in enumerate(designs.items()):
        columns = {
            "logs so far": [e.before for e in design.expected],
            "growing sinusoid": [e.default for e in design.expected],
            "designed motion": [e.after for e in design.expected],
        }
        sections.append(
            PageSection(
                name,
                (*design.sentences, start_text(design)),
                plots=(motion_plot(design, f"m{number}"),),
                tables=(expected_table(design.expected, columns),),
                aside=f"goal {design.goal.text}",
            )
        )
    return plain_page("The next experiment", "design", (), sections)


def expected_table(expected: Sequence[Expected], columns: Mapping[str, Sequence[float]]) -> PageTable:
    """The quantities with their units and values, by heading."""
    rows = [
        (each.name, pretty_unit(each.unit), *map(number_text, values))
        for each, *values in zip(expected, *columns.values(), strict=True)
    ]
    return PageTable(("quantity", "unit", *columns), rows, tuple(columns))


def start_text(design: JointDesign) -> str:
    """Where the motion begins and how long it lasts."""
    time, motion = design.motion(100.0)
    start = f"{significant(float(motion[0, 0]), 4)} {design.limits.units.position}"
    told = f"Move the joint to {start} and let it rest. The motion begins and ends at rest and lasts {time[-1]:.4g} s"
    limits = "Dashed lines are the limits of the joint."
    if design.sinusoid is not None:
        return f"{told}. {limits}"
    periods = "one period" if design.repeats == 1 else f"{design.repeats} periods"
    return f"{told}: {periods} of {design.basis.period:.4g} s, with a lead-in and a lead-out. {limits}"


def number_text(value: float) -> str:
    """A number for a table; a dash where there is none."""
    return "–" if np.isnan(value) else significant(value)


def motion_plot(design: JointDesign, name: str) -> str:
    """Position, velocity and acceleration over one period, or the whole sinusoid, with their limits."""
    return _plot_of(*design.one, design.limits, design.joint.name, name)


def _plot_of(motion: FloatArray, step: float, limits: JointLimits, joint: str, name: str) -> str:
    """The same of a motion (4, T)."""
    time = np.arange(motion.shape[1]) * step
    labels: Sequence[tuple[str, tuple[float, float]]] = (
        (limits.units.text("q [rad]"), limits.position),
        (limits.units.text("velocity [rad/s]"), (-limits.velocity, limits.velocity)),
        (limits.units.text("acceleration [rad/s²]"), (-limits.acceleration, limits.acceleration)),
    )
    with page_style(name):
        figure = new_figure(9.0, 5.0)
        for row, (label, bounds) in enumerate(labels):
            axes = figure.add_subplot(3, 1, row + 1)
            axes.plot(time, motion[row], color=FORWARD)
            for bound in bounds:
                axes.axhline(bound, color=BACKWARD, linewidth=0.8, linestyle="--")
            axes.set_ylabel(label)
            axes.tick_params(labelbottom=row == len(labels) - 1)
        axes.set_xlabel("time [s], one period")
        return to_svg(figure, f"designed motion of {joint}")


KNOT = 0.02
"""Time between knots, about [s]: position, velocity and acceleration are exact there."""


def drake_trajectory(time: FloatArray, motions: Mapping[str, FloatArray]) -> str:
    """YAML of a `PiecewisePolynomial` of degree 5 through position, velocity and acceleration at knots.

    Between knots the position errs by h^6/46080 of its sixth derivative at most (Hermite): 3e-7 of the amplitude at
    4 Hz.

    Args:
        time: (T,) [s], evenly spaced.
        motions: By joint, (4, T) position, velocity, acceleration and jerk.
    """
    every = max(1, round(KNOT / float(time[1] - time[0])))
    picked = np.unique(np.append(np.arange(0, time.size, every), time.size - 1))
    knots = time[picked]
    rows = []
    for motion in motions.values():
        spline = PPoly.from_bernstein_basis(BPoly.from_derivatives(knots, motion[:3, picked].T))
        rows.append(spline.c[::-1].T.tolist())  # by segment, lowest power first
    polynomials = [[[row[k]] for row in rows] for k in range(knots.size - 1)]
    lines = ",\n".join(json.dumps(each) for each in polynomials)
    return f'{{"breaks": {json.dumps(knots.tolist())},\n"polynomials": [\n{lines}\n]}}\n'
