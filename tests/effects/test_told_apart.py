"""Effects that resemble each other: the simulated one explains the log better than those it could be taken for.

Every log is simulated with one effect and fitted with each of its group. The comparison is of cross-validated errors,
at the best shape of each, as the search makes it. A factor of 1.02 decides there; this test asks for more.
"""

from collections.abc import Mapping
from dataclasses import replace

import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.diagnosis.data.preparation import build_samples, context_of
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.selection.joint_problem import best_shape
from drake_tc.diagnosis.selection.shape_refinement import refine
from drake_tc.effects.library import effect
from drake_tc.logs.rig import parse_rig
from drake_tc.loops.joint_bench.recording import record_bench

from .test_identify_back import BENCH, COULOMB, GAIN, INERTIA, VISCOUS, motion

SHORT = replace(BENCH, duration=8.0)
CLEARLY = 1.3

GROUPS: dict[str, tuple[str, dict[str, dict[str, float]]]] = {
    "compliance and delay": (
        "position_servo",
        {"elasticity": {"compliance": 4e-4}, "delay.command": {"delay": 0.006}, "delay.loop": {"delay": 0.006}},
    ),
    "three delays": (
        "current",
        {
            "delay.loop": {"delay": 0.006},
            "delay.torque_sensor": {"delay": 0.006},
            "delay.position_sensor": {"delay": 0.006},
        },
    ),
    "friction under load": (
        "current",
        {
            "directional_efficiency": {"driving_friction": 0.1, "backdriven_friction": 0.3},
            "load_dependent_friction": {"load_friction": 0.15},
            "velocity_sign_switch": {"switch": 0.1},
        },
    ),
    "lags of a voltage drive": (
        "voltage",
        {"current_lag.winding": {"lag": 0.02, "back_emf": 1.6}, "current_lag": {"lag": 0.02}},
    ),
    "a drive that warms": (
        "voltage",
        {
            "winding_temperature": {"resistance_per_kelvin": 0.0039, "back_emf": 1.2},
            "thermal_friction": {"coulomb_per_kelvin": -0.04, "viscous_per_kelvin": -0.08, "thermal_rate": 0.02},
        },
    ),
}


def errors(drive: str, key: str, truth: Mapping[str, float], candidates: list[str]) -> dict[str, tuple[float, int]]:
    """(cross-validated error, number of parameters) of the declared model ("none") and with each candidate."""
    base = (("rotor_inertia", INERTIA), ("viscous", VISCOUS), ("coulomb", COULOMB))
    values = (*(EffectValue(name, {name: x}) for name, x in base), EffectValue(key, truth))
    run = record_bench(ActuatorModel("joint", Drive(drive, GAIN[drive]), values), motion(drive, SHORT, 1.0), SHORT)
    declared = {"rotor_inertia": INERTIA + 0.5 * VISCOUS * BENCH.step}
    rig = parse_rig({"joint": "joint", "drive": drive, "declared": declared})
    samples = build_samples([run], rig, "joint")
    context = context_of(samples, rig, "joint")
    columns = Columns(samples)
    plain = fit(columns, [Term(effect("viscous")), Term(effect("coulomb"))])
    columns = columns.with_model(plain.terms, plain.beta, servo=drive == "position_servo")
    plain = fit(columns, plain.terms)
    out = {"none": (plain.cv_rms, plain.size)}
    for name in candidates:
        best = refine(columns, best_shape(columns, plain, effect(name), context), evaluations=25)
        out[name] = best.cv_rms, best.size
    return out


@pytest.mark.parametrize(
    ("group", "key"), [(group, key) for group, (_, members) in GROUPS.items() for key in members], ids=lambda x: x
)
def test_the_simulated_one_explains_its_log_best(group, key):
    drive, members = GROUPS[group]
    found = errors(drive, key, members[key], list(members))
    own, size = found.pop(key)
    for name, (error, others) in found.items():
        if name != "none" and others > size:  # it contains the true one: no better is all that can be asked
            assert error > own / 1.02, f"{name} explains {key} better: {error:.3g} against {own:.3g}"
        else:
            assert error > CLEARLY * own, f"{name} explains {key} as well: {error:.3g} against {own:.3g}"
