"""A result made by hand: a joint with a Stribeck peak and a ripple, fitted with and without them."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.notes import LogRemark
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.problem.regression import Fit, fit, predict
from drake_tc.diagnosis.residual.unexplained import DataSplit, RepeatRun, TimeStretch, Unexplained
from drake_tc.diagnosis.result.joint_result import Errors, FoundEffect, JointResult, RejectedEffect
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.effects.library import effect
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

PERIOD = 2e-3
GAIN = 0.1
RIPPLE = {"cycles_per_turn": 20.0}
STRIBECK = {"stribeck_velocity": 0.2, "stribeck_exponent": 2.0}


def record(name: str, seed: int, seconds: float = 12.0, *, temperature: bool = False) -> Run:
    """One run of the joint `knee`: a current drive against viscous, Coulomb and Stribeck friction and a ripple."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, PERIOD)
    omega = 2.0 * np.pi * np.array([0.31, 0.73]) * (1.0 + 0.02 * seed)
    phase = rng.uniform(0.0, 6.0, 2)
    q = np.sum(np.array([0.8, 0.3])[:, None] * np.sin(omega[:, None] * time + phase[:, None]), axis=0)
    v = np.sum((np.array([0.8, 0.3]) * omega)[:, None] * np.cos(omega[:, None] * time + phase[:, None]), axis=0)
    tau = 6.0 * np.sin(2.0 * np.pi * 0.17 * time)
    peak = 2.0 * np.exp(-((np.abs(v) / 0.2) ** 2)) * np.sign(v)
    torque = tau + 1.5 * v + 1.0 * np.sign(v) + peak + 0.4 * np.cos(20.0 * q)
    columns = {
        "knee/position": q + rng.normal(0.0, 1e-6, q.size),
        "knee/current": GAIN * torque + rng.normal(0.0, 2e-3, q.size),
        "knee/torque": tau + rng.normal(0.0, 1e-3, q.size),
    }
    if temperature:
        columns["knee/temperature"] = 25.0 + 0.5 * time
    return Run(name, None, time, PERIOD, columns, np.zeros(time.size, dtype=np.int64))


def estimates(fitted: Fit) -> dict[str, dict[str, Estimate]]:
    """Parameters of a fit with made-up intervals of 1 %."""
    out = {"drive": {"gain": Estimate(fitted.gain, "A/(N*m)", (0.99 * fitted.gain, 1.01 * fitted.gain), False)}}
    at = 1
    for term in fitted.terms:
        count = len(term.effect.coefficients)
        values = term.effect.physical(fitted.beta[at : at + count], term.shape, fitted.gain)
        units = {p.name: p.unit for p in term.effect.parameters}
        out[term.effect.key] = {
            n: Estimate(v, units[n], (v - 0.01 * abs(v), v + 0.01 * abs(v)), n == "stribeck_exponent")
            for n, v in values.items()
        }
        at += count
    return out


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.fixture(scope="session")
def joint() -> JointResult:
    """Both effects found; the knee's two training runs and one held-out run."""
    rig = parse_rig({"joint": "knee", "drive": "current", "declared": {}}, "rig.yaml")
    samples = build_samples([record("slow", 1), record("wide", 2)], rig, "knee")
    train = Columns(samples)
    held = Columns(build_samples([record("fast", 3)], rig, "knee", width_s=samples.light.width_s))
    plain = [Term(effect("viscous")), Term(effect("coulomb"))]
    found = [Term(effect("stribeck"), STRIBECK), Term(effect("torque_ripple"), RIPPLE)]
    baseline, final = fit(train, plain), fit(train, [*plain, *found])
    before, after = estimates(baseline), estimates(final)
    sides = (
        DataSplit(train.samples, baseline.residual, final.residual),
        DataSplit(held.samples, predict(held, baseline), predict(held, final)),
    )
    effects = tuple(
        FoundEffect(t.effect.key, t.effect.id, t.effect.title, after[t.effect.key], 0.6, 0.97, 0.05) for t in found
    )
    time = np.arange(0.0, 8.0, 0.01)
    recorded = np.sin(time)
    trace = {"time": time, "recorded": recorded, "before": recorded + 0.04, "after": recorded + 0.01}
    return JointResult(
        joint="knee",
        drive="current",
        unit="A",
        baseline=baseline,
        final=final,
        baseline_parameters=before,
        final_parameters=after,
        noise_floor=6e-4,
        before=Errors(baseline.rms, rms(sides[1].before), 0.04),
        after=Errors(final.rms, rms(sides[1].after), 0.01),
        effects=effects,
        rejected=(
            RejectedEffect("delay", "delay", "too_little_evidence", "", 0.7, 0.011),
            RejectedEffect("thermal_friction", "thermal_friction", "not_recorded", "temperature not recorded"),
        ),
        indistinguishable=(("stribeck", "presliding_hysteresis"),),
        next_experiment=RepeatRun("a & <b>", 1.0, 2.5),
        unexplained=Unexplained(1.1, 1.1, False, 0.01, 0.04, False, (), (), None, 5e-4),
        verdict="effects_found",
        train=sides[0],
        heldout=sides[1],
        free_run={"fast": trace},
        notes=(LogRemark("slow", "3 rows filled"),),
    )


@pytest.fixture(scope="session")
def result(joint: JointResult) -> CloseLoopResult:
    """A call with one joint, both model files given."""
    return CloseLoopResult(
        joints={"knee": joint},
        verdict="effects_found",
        seconds=3.21,
        train_files=("logs/a/slow.csv", "logs/a/wide.csv"),
        heldout_files=("logs\\b\\fast.csv",),
        rig_file="rigs/knee.yaml",
        model_before_yaml="joints:\n  knee:\n    effects:\n      - {effect: viscous, viscous: 1.7}\n",
        model_after_yaml="joints:\n  knee:\n    effects:\n      - {effect: viscous, viscous: 1.5}\n"
        "      - {effect: stribeck}\n",
    )


@pytest.fixture(scope="session")
def unexplained_joint(joint: JointResult) -> JointResult:
    """Nothing found, structure left in a stretch, at a frequency, and in two signals; no free run."""
    return replace(
        joint,
        joint="<hip> & co",
        final=joint.baseline,
        final_parameters=joint.baseline_parameters,
        after=Errors(joint.before.train, joint.before.heldout, None),
        before=Errors(joint.before.train, joint.before.heldout, None),
        effects=(),
        rejected=(),
        indistinguishable=(),
        next_experiment=None,
        train=replace(joint.train, after=joint.train.before),
        heldout=replace(joint.heldout, after=joint.heldout.before),
        unexplained=Unexplained(
            40.0,
            40.0,
            True,
            0.3,
            0.7,
            True,
            ("velocity", "expected_torque", "time"),
            (TimeStretch("fast", 2.0, 3.5),),
            4.2,
            0.02,
        ),
        verdict="unexplained_structure",
        free_run={},
        notes=(),
    )
