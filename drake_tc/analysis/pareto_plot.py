"""The Pareto front of a tuning, drawn: error against sensitivity peak, joint by joint; noise as colour."""

from typing import Any

import numpy as np

from drake_tc.analysis.settings import Assessed
from drake_tc.analysis.tuning import TunedJoint, Tuning

LARGEST_PEAK = 4.0


def draw_fronts(figure: Any, tuning: Tuning) -> None:
    """Draw into a matplotlib Figure: one panel a joint, the front's settings coloured by their noise.

    A line joins those that nothing beats in error and peak alone; a square is the present setting, a star the tuned.
    """
    joints = tuning.joints
    columns = min(3, len(joints))
    rows = -(-len(joints) // columns)
    axes = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    drawn = [each for joint in joints for each in joint.front]
    noises = [each.noise for each in drawn if each.noise > 0.0] or [1.0]
    limits = {"vmin": np.log10(min(noises)), "vmax": np.log10(max(noises))}
    points = None
    for axis, joint in zip(axes, joints, strict=False):
        points = _draw_joint(axis, joint, limits) or points
    for axis in axes[len(joints) :]:
        axis.set_visible(False)
    if points is not None and max(noises) > min(noises):
        figure.colorbar(points, ax=axes.tolist(), label="noise in the command, log10 of N m RMS")
    figure.supxlabel("sensitivity peak [-]")
    figure.supylabel("predicted RMS tracking error [mrad]")


def _draw_joint(axis: Any, joint: TunedJoint, limits: dict[str, Any]) -> Any:
    shown = [each for each in joint.front if each.sensitivity_peak <= LARGEST_PEAK]
    points = None
    if shown:
        noise = np.log10(np.maximum([each.noise for each in shown], 1e-12))
        points = axis.scatter(*_place(shown), c=noise, s=10, cmap="viridis", **limits)
    edge, best = [], np.inf
    for each in sorted(shown, key=lambda a: a.sensitivity_peak):
        if each.error < best:
            edge.append(each)
            best = each.error
    axis.plot(*_place(edge), color="0.6", linewidth=1.0, drawstyle="steps-post")
    if joint.before is not None:
        axis.plot(*_place([joint.before]), "s", color="tab:red", label="present")
    axis.plot(*_place([joint.after]), "*", color="tab:orange", markersize=12, label="tuned")
    if joint.goal.sensitivity_peak <= LARGEST_PEAK:
        axis.axvline(joint.goal.sensitivity_peak, color="tab:red", linestyle=":", linewidth=1.0)
    axis.set_title(joint.joint, fontsize="small")
    axis.set_yscale("log")
    axis.legend(fontsize="x-small")
    return points


def _place(settings: list[Assessed]) -> tuple[list[float], list[float]]:
    return [each.sensitivity_peak for each in settings], [1e3 * each.error for each in settings]
