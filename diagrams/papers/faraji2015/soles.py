"""Faraji et al. (2015), beyond it: what the base estimator has to know of soles and floor."""

from typing import Any

from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.diagrams.papers.faraji2015.motions import SCENARIOS, BaseErrors, base_errors, rmse_values
from drake_tc.loops.whole_body.running import simulate_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.types import TextTable, text_rows

KNOWN = {
    "as it is": "{beside: foot_centre}",
    "stiffness 30 % too large": "{beside: foot_centre, sole_stiffness: 1.3e+5}",
    "stiffness 30 % too small": "{beside: foot_centre, sole_stiffness: 0.7e+5}",
    "taken for rigid": "{beside: foot_centre, sole_stiffness: null}",
    "rigid, floor not known to be level": "{beside: foot_centre, sole_stiffness: null, tuning: {ground: unknown}}",
}
"""What the estimator in the loop is told of soles of 1e5 N/m on a level floor: laid over `estimator`."""
WITH_IMU = "{beside: foot_centre_imu}"
CHAIN, IMU_CHAIN = "foot centre, in the first run", "foot centre with the IMU"
NOTES = (
    "Simulated: the turn at 0.5 Hz, the estimator in the loop told other things of the same soles and floor; each run's"
    " errors over those of the chain from the foot's centre, which is told nothing and sees no IMU, in that run.",
    "With the IMU: that chain with roll, pitch and rates of the IMU; it knows neither soles nor a level floor.",
)


def soles(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """C.soles: base errors by what the estimator is told of soles and floor."""
    ours: dict[str, BaseErrors] = {}
    chain: dict[str, BaseErrors] = {}
    values: dict[str, float] = {}
    for number, (name, text) in enumerate(KNOWN.items()):
        if progress:
            progress(name, number / (len(KNOWN) + 1))
        scenario = TsidScenario.load(SCENARIOS, "turn_half_hz", f"{{estimator: {text}}}")
        run = simulate_tsid(scenario.changed(seed=seed))
        ours[name], chain[name] = (base_errors(run, signal) for signal in ("estimated_state", "beside_state"))
        values[f"{name}: fell"] = float(run.fell is not None)
        for what in ("position", "velocity", "yaw"):
            values[f"{name}: base {what} error, ours over foot centre"] = getattr(ours[name], what) / getattr(
                chain[name], what
            )
    if progress:
        progress(IMU_CHAIN, 1.0 - 1.0 / (len(KNOWN) + 1))
    scenario = TsidScenario.load(SCENARIOS, "turn_half_hz", f"{{estimator: {WITH_IMU}}}").changed(seed=seed)
    run = simulate_tsid(scenario)
    best, chain[IMU_CHAIN] = (base_errors(run, signal) for signal in ("estimated_state", "beside_state"))
    for what in ("position", "velocity", "yaw"):
        values[f"base {what} error, ours over {IMU_CHAIN}"] = getattr(best, what) / getattr(chain[IMU_CHAIN], what)
    shown = {**ours, CHAIN: next(iter(chain.values())), IMU_CHAIN: chain[IMU_CHAIN]}
    for name, errors in shown.items():
        values |= rmse_values(name, errors)
    columns: list[Any] = [[getattr(one, what) for one in shown.values()] for what in ("position", "velocity", "yaw")]
    headings = ("told", "position [m]", "velocity [m/s]", "yaw [rad]")
    table = TextTable("RMS errors of the base", headings, text_rows(list(shown), columns, ".3g"))
    return Reproduction("C.soles", evaluated(values, expectations("c_soles")), (table,), NOTES)
