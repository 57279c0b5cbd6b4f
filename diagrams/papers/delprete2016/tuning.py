"""An open question of Del Prete et al. (2016).

Which window and which gains, joint by joint; and whether they hold on other plants.
"""

from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np

from drake_tc.analysis.sweep import processes
from drake_tc.analysis.torque_loop.tuned import Confirmed, PerturbedPlants, Spread, confirm, joint_tasks
from drake_tc.analysis.tuning import Tuning, default_goals, draw_fronts, tune
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.registry import diagram_entry
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.types import TextTable

BEGIN = 0.28
"""Errors of the brisk swing are taken from just before it begins [s]."""
SWING_BEGIN = 0.75
"""Those of the longer swing, which took no part in the tuning [s]."""
IDENTIFIED = "../models/hrp2_like/hrp2_like_leg_identified.yaml"
"""The drives as `close-loop` identified them: all that the tuning knows of them."""
LATENCIES = (1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3)
"""Of all sensors [s]: an uncertainty that the linear margins stand for."""
LOST = 0.01
"""A joint with this RMS error [rad] oscillates; the swing's own errors are a few 10^-3."""
PLANTS = 100
WORKERS = 2
SPREAD = Spread()
NOTES = (
    "Simulated. Tuned on the brisk swing, from the drives as `close-loop` identified them; K6 = 1 stays. Each joint"
    " keeps its sensitivity peak and delay margin (linear, one joint, cut at the drive's effort, worst of three"
    " postures) and lets no more noise into the effort than the vendor's servo makes of its encoder's.",
    "Paper's setting: N = 80, Kp = 2, Ki = 0, K6 = 1, and K7 = 0.01 s, as in Tables 2 and 3.",
    f"{PLANTS} plants in the complete leg loop: K_tau and K_v drawn +-{SPREAD.k_tau:.0%}, dry friction and dead zone"
    f" +-{SPREAD.dry:.0%}, link masses +-{SPREAD.mass:.0%}, uniform, joint by joint; the controller's model stays.",
)


def confirmed_leg(
    found: Tuning,
    plants: int = PLANTS,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Confirmed:
    """Both settings simulated: on the motion, on the longer swing, and on perturbed plants."""
    names = (("brisk_swing", BEGIN), ("stairs_swing", SWING_BEGIN))
    motions = [(diagram_entry("hrp2_leg").scenario(name).changed(seed=seed), begin) for name, begin in names]
    return confirm(motions, found, PerturbedPlants(plants, SPREAD, seed), executor=executor, progress=progress)


def late_sensors(scenario: Scenario, latency: float) -> Scenario:
    """The scenario with every sensor that much older [s]."""
    late = {name: {"latency": latency} for name in ("encoder", "gyro", "accel", "force", "torque")}
    return replace(scenario, sensors={"preset": "realistic", **late})


def latencies_held(found: Tuning, seed: int = 0, executor: Executor | None = None) -> tuple[float, float]:
    """The largest sensor latency [s] up to which the complete loop keeps its errors small, (paper's, tuned)."""
    scenario = diagram_entry("hrp2_leg").scenario("brisk_swing").changed(seed=seed)
    motions = [(late_sensors(scenario, late), BEGIN) for late in LATENCIES]
    errors = confirm(motions, found, PerturbedPlants(seed=seed), executor=executor).nominal  # (L, 2, n)
    held = np.cumprod(np.all(errors < LOST, axis=2), axis=0).sum(axis=0)
    return tuple(float(LATENCIES[k - 1]) if k else 0.0 for k in held)  # type: ignore[return-value]


def tuned_leg(executor: Executor | None = None, progress: Progress | None = None) -> Tuning:
    """Window and gains of the leg's joints for the brisk swing, each at its present margins or better."""
    scenario = diagram_entry("hrp2_leg").scenario("brisk_swing")
    tasks = joint_tasks(replace(scenario, actuators=IDENTIFIED), BEGIN)
    return tune(tasks, default_goals(tasks), executor=executor, progress=progress)


def tuning(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """A.tune: tuned, and confirmed on 100 perturbed plants."""

    def part(first: float, last: float, what: str) -> Progress | None:
        if progress is None:
            return None
        return lambda text, share: progress(f"{what}, {text}", first + share * (last - first))

    with processes(WORKERS) as executor:
        found = tuned_leg(executor, part(0.0, 0.2, "tuning"))
        confirmed = confirmed_leg(found, PLANTS, seed, executor, part(0.2, 0.95, "swings"))
        late = latencies_held(found, seed, executor)
    return Reproduction(
        "A.tune",
        evaluated(values(found, confirmed) | _late(late), expectations("a_tune")),
        tables(found, confirmed),
        NOTES,
        {"pareto": lambda figure: draw_fronts(figure, found), "plants": lambda figure: _draw_plants(figure, confirmed)},
    )


def values(found: Tuning, confirmed: Confirmed) -> dict[str, float]:
    """The figures that are evaluated, by name."""
    nominal, other = (pair[1] / pair[0] for pair in confirmed.nominal)
    before = [joint.before for joint in found.joints if joint.before is not None]
    after = [joint.after for joint in found.joints]
    pairs = list(zip(before, after, strict=True))
    ratios = confirmed.plant_ratios
    predicted = np.array([a.error / b.error for b, a in pairs])
    return {
        "tracking error, tuned over paper's, geometric mean of joints": float(np.exp(np.mean(np.log(nominal)))),
        "tracking error, tuned over paper's, worst joint": float(nominal.max()),
        "tracking error on another swing, tuned over paper's, geometric mean": float(np.exp(np.mean(np.log(other)))),
        "sensitivity peak, tuned over paper's, worst joint": max(
            a.sensitivity_peak / b.sensitivity_peak for b, a in pairs
        ),
        "delay margin, tuned over paper's, worst joint": min(a.delay_margin / b.delay_margin for b, a in pairs),
        "noise in the effort over the vendor servo's, worst joint": max(
            j.after.noise / j.goal.noise for j in found.joints
        ),
        "perturbed plants: tuned over paper's, median": float(np.median(ratios)),
        "perturbed plants: tuned over paper's, worst plant": float(ratios.max()),
        "perturbed plants: share with 30 % less error or better": float(np.mean(ratios <= 0.7)),
        "perturbed plants: ran away": float(np.sum(~np.isfinite(confirmed.plants[:, 1]).all(axis=1))),
        "perturbed plants: share of their joints that get worse": float(
            np.mean(confirmed.plants[:, 1] > confirmed.plants[:, 0])
        ),
        "perturbed plants: worst joint of any plant": float((confirmed.plants[:, 1] / confirmed.plants[:, 0]).max()),
        "predicted over simulated ratio, geometric mean": float(np.exp(np.mean(np.log(predicted / nominal)))),
        "window": float(found.window),
    }


def _late(held: tuple[float, float]) -> dict[str, float]:
    paper, tuned = held
    return {
        "sensor latency held in the complete loop, tuned minus paper's": 1e3 * (tuned - paper),
        "sensor latency held in the complete loop, paper's": 1e3 * paper,
    }


def tables(found: Tuning, confirmed: Confirmed) -> tuple[TextTable, ...]:
    """What was chosen, and what it does."""
    settings = []
    for i, joint in enumerate(found.joints):
        before, after, chosen = joint.before, joint.after, joint.after.setting
        if before is None:
            continue
        numbers = (
            f"{chosen.kp:.2f}",
            f"{chosen.ki:.1f}",
            f"{1e3 * chosen.k7:.1f}",
            f"{1e3 * before.error:.3f} > {1e3 * after.error:.3f}",
            f"{1e3 * confirmed.nominal[0, 0, i]:.3f} > {1e3 * confirmed.nominal[0, 1, i]:.3f}",
            f"{before.sensitivity_peak:.2f} > {after.sensitivity_peak:.2f}",
            f"{1e3 * before.delay_margin:.1f} > {1e3 * after.delay_margin:.1f}",
        )
        settings.append((joint.joint, *numbers))
    headings = (
        "joint",
        "Kp",
        "Ki [1/s]",
        "K7 [ms]",
        "error predicted [mrad]",
        "error simulated [mrad]",
        "peak",
        "delay [ms]",
    )
    return (
        TextTable(
            f"paper's setting > tuned, window {found.window}, {found.tried} settings tried", headings, tuple(settings)
        ),
    )


def _draw_plants(figure: Any, confirmed: Confirmed) -> None:
    axes = figure.subplots()
    before, after = (1e3 * np.exp(np.mean(np.log(confirmed.plants[:, k]), axis=1)) for k in (0, 1))
    axes.scatter(before, after, s=12)
    limit = 1.05 * float(np.max(before))
    axes.plot([0.0, limit], [0.0, 0.7 * limit], "k--", label="30 % less")
    axes.set(
        xlim=(0.0, limit), ylim=(0.0, limit), xlabel="paper's setting: RMS tracking error [mrad]", ylabel="tuned [mrad]"
    )
    axes.legend()
