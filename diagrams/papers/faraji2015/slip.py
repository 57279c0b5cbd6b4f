"""Faraji et al. (2015), beyond it: the base while feet turn on a floor that is too smooth for the motion."""

from typing import Any

import numpy as np

from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.diagrams.papers.faraji2015.motions import BASELINE, OURS, SCENARIOS, SINCE, base_errors, rmse_values
from drake_tc.loops.whole_body.running import TsidRecording, simulate_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.types import FloatArray, TextTable, text_rows

NOTES = (
    "Simulated: the turn at 0.5 Hz on a floor of friction 0.3 in place of 0.8, the controller knowing of 0.5; both"
    " estimators in the same run, ours in the loop. Ours is told that the floor is level and how stiff the soles are.",
)


def feet_yaw(run: TsidRecording) -> FloatArray:
    """(S, k) how far each foot has turned about the vertical since `SINCE` [rad], one sample in ten."""
    law, found = run.law, []
    scratch, nq = law.model.create_scratch(), law.model.nq
    for state in run["state"][run.time > SINCE][::10]:
        terms = law.model.terms(scratch, state[:nq], state[nq:])
        rotations = [terms.pose(contact.name)[0] for contact in law.model.contacts]
        found.append([np.arctan2(rotation[1, 0], rotation[0, 0]) for rotation in rotations])
    turned = np.unwrap(np.array(found), axis=0)
    return np.asarray(turned - turned[0])


def slip(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """C.slip: base errors of both estimators while feet turn on a smooth floor."""
    if progress:
        progress("turn on a smooth floor", 0.0)
    scenario = TsidScenario.load(SCENARIOS, "turn_half_hz_smooth", "{estimator: {beside: foot_centre}}")
    run = simulate_tsid(scenario.changed(seed=seed))
    ours, theirs = (base_errors(run, signal) for signal in ("estimated_state", "beside_state"))
    turned = np.abs(feet_yaw(run)).max(axis=0)
    values: dict[str, float] = {"fell": float(run.fell is not None)}
    for name in ("position", "velocity", "yaw"):
        values[f"base {name} error, ours over foot centre"] = getattr(ours, name) / getattr(theirs, name)
    values |= rmse_values(OURS, ours) | rmse_values(BASELINE, theirs)
    contacts = [contact.name for contact in run.law.model.contacts]
    values |= {f"{name}: turned by at most [rad]": angle for name, angle in zip(contacts, turned.tolist(), strict=True)}
    columns: list[Any] = [[getattr(one, name) for one in (ours, theirs)] for name in ("position", "velocity", "yaw")]
    headings = ("estimator", "position [m]", "velocity [m/s]", "yaw [rad]")
    table = TextTable("RMS errors of the base", headings, text_rows(["CoP", "foot centre"], columns, ".3g"))
    feet = TextTable(
        "feet",
        ("foot", "turned by at most [rad]"),
        text_rows(contacts, [turned.tolist()], ".3f"),
    )
    return Reproduction("C.slip", evaluated(values, expectations("c_slip")), (table, feet), NOTES)
