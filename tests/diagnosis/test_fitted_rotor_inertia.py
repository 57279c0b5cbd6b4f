"""A rotor inertia that is fitted, on a joint whose load is a pendulum and nothing else.

The load is tau = J_l qddot + m g l sin q then, so that J qddot = (J/J_l) (tau - m g l sin q): a smaller 1/K and a
function of the position explain the rotor as well as its inertia does, without the noise of an acceleration.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from drake_tc.diagnosis.data.preparation import build_samples, context_of
from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.column_noise import attenuation
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import fit, noise_floor
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.selection.rotor_inertia import leaves_noise_of_its_inertia, replaces_inertia
from drake_tc.effects.base import Context, Parameter, Signature, TorqueEffect
from drake_tc.effects.library import effect
from drake_tc.effects.unknown_load import SMOOTH_LOADS
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

from .rigs import COMMAND, Joint, Waves, sines

STEP = 2e-5
WAVES = (
    (0.19, 0.26, 4.4),
    (0.36, 0.19, 0.7),
    (0.98, 0.11, 2.3),
    (0.74, 0.13, 3.1),
    (0.2, 0.25, 2.6),
    (0.58, 0.15, 3.5),
    (0.63, 0.14, 4.4),
    (0.28, 0.21, 5.7),
)
PENDULUM = Joint(drive="position_servo", gain=2e-3, encoder_step=STEP, encoder_noise=0.3 * STEP, torque_noise=0.02)

FAST = tuple((0.6 + 0.775 * k, 0.05, phase) for k, phase in enumerate((0.2, 1.9, 3.3, 4.1, 5.6)))
"""Small and fast, so that the acceleration's noise is most of what is left."""
NOISY = Joint(period=5e-4, duration=8.0, gain=0.1, viscous=3.0, coulomb=2.0, encoder_step=3e-5, torque_noise=0.02)
RIG = parse_rig({"joint": "joint", "drive": "current"})
DECLARED = ("viscous", "coulomb", "rotor_inertia")


def hung(joint: Joint, seed: int, waves: Waves = WAVES) -> Run:
    """A pendulum of 5 N m and 0.5 kg m^2, its torque measured."""
    rng, time = np.random.default_rng(seed), joint.times()
    q, v, a = sines(time, waves, 0.37 * seed)
    load = 0.5 * a + 5.0 * np.sin(q)
    effort = joint.gain * (load + joint.inertia * a + joint.viscous * v + joint.coulomb * np.sign(v))
    columns = {
        "joint/position": joint.encoder(q, rng),
        "joint/torque": load + joint.torque_noise * rng.standard_normal(time.size),
        f"joint/{COMMAND[joint.drive]}": effort + (q if joint.drive == "position_servo" else 0.0),
    }
    return joint.run(f"run{seed}", columns)


def diagnosed(joint: Joint, waves: Waves = WAVES, **keys: object) -> JointResult:
    rig = parse_rig({"joint": "joint", "drive": joint.drive, "command_hold": False, **keys})
    runs = [hung(joint, seed, waves) for seed in range(3)]
    return diagnose_joint(runs[:2], runs[2:], rig, "joint", DiagnosisOptions(assess_residual=False))


@pytest.mark.parametrize("noise", [1.0], ids=lambda share: f"{share} steps")
def test_nothing_is_missing_where_the_rotor_inertia_is_declared_without_a_value(noise):
    result = diagnosed(replace(PENDULUM, encoder_noise=noise * STEP), declared=["rotor_inertia"])
    assert result.effects == ()
    found = result.final_parameters["rotor_inertia"]["rotor_inertia"]
    assert found.value == pytest.approx(PENDULUM.inertia, rel=0.02)


def test_an_undeclared_rotor_is_found_where_the_drive_gain_is_known():
    result = diagnosed(PENDULUM, drive_gain=PENDULUM.gain)
    assert [each.id for each in result.effects] == ["rotor_inertia"]
    assert result.effects[0].parameters["rotor_inertia"].value == pytest.approx(PENDULUM.inertia, rel=0.02)


def terms(*names: str) -> list[Term]:
    return [Term(e, e.shape_grid(context())[0]) for e in map(effect, names)]


def noisy(seed: int) -> Columns:
    samples = build_samples([hung(NOISY, seed, FAST)], RIG, "joint")
    first = Columns(samples)
    return first.with_model(terms(*DECLARED), fit(first, terms(*DECLARED)).beta, servo=False)


@cache
def context() -> Context:
    return context_of(build_samples([hung(NOISY, 0, FAST)], RIG, "joint"), RIG, "joint")


@pytest.mark.parametrize("name", ["cable_spring", "position_dependent_load"])
@pytest.mark.parametrize("seed", range(2))
def test_an_effect_that_takes_the_place_of_the_inertia_is_not_believed(seed, name):
    columns = noisy(seed)
    declared, both = fit(columns, terms(*DECLARED)), fit(columns, terms(*DECLARED, name))
    assert both.rms < 0.65 * declared.rms  # by what the search compares, it would be chosen
    found = replaces_inertia(columns, both, both.terms[-1], set(DECLARED), noise_floor(columns, declared))
    assert found is not None
    assert found.inertia == pytest.approx(declared.beta[-1])


def test_an_effect_beside_which_the_inertia_stays_may_be_believed():
    columns = noisy(0)
    declared, both = fit(columns, terms(*DECLARED)), fit(columns, terms(*DECLARED, "torque_sensor_bias"))
    noise = noise_floor(columns, declared)
    assert replaces_inertia(columns, both, both.terms[-1], set(DECLARED), noise) is None


def test_an_effect_may_be_believed_where_the_declared_model_leaves_more_than_noise():
    columns = noisy(0)
    declared, both = fit(columns, terms(*DECLARED)), fit(columns, terms(*DECLARED, "position_dependent_load"))
    assert replaces_inertia(columns, both, both.terms[-1], set(DECLARED), declared.rms / 2.5) is None


def test_an_added_rotor_that_leaves_its_own_noise_is_recognised():
    columns = noisy(0)
    with_rotor, with_spring = (
        fit(columns, terms("viscous", "coulomb", name)) for name in ("rotor_inertia", "cable_spring")
    )
    assert leaves_noise_of_its_inertia(columns, with_rotor, {"viscous", "coulomb"})
    assert not leaves_noise_of_its_inertia(columns, with_rotor, set(DECLARED))
    assert not leaves_noise_of_its_inertia(columns, with_spring, {"viscous", "coulomb"})


def test_what_the_noise_of_the_acceleration_moves_is_known():
    """The mean error of every coefficient over eight logs, to four tenths of it."""
    found = []
    for seed in range(8):
        columns = noisy(seed)
        fitted = fit(columns, terms(*DECLARED))
        found.append((fitted.beta, attenuation(columns, fitted)))
    beta, moved = np.mean(found, axis=0)
    true = np.array([1.0 / NOISY.gain, NOISY.viscous, NOISY.coulomb, NOISY.inertia])
    assert (true - beta > 0.15 * true).all()
    assert true - beta == pytest.approx(moved, rel=0.4)


@pytest.mark.parametrize(("drive", "gain"), [("current", 0.1), ("position_servo", 0.01)])
def test_what_the_noise_moves_beside_an_unknown_load_is_known(drive, gain):
    """As above, with the inertia of rotor and load together and a gain that is held; a smooth load, as the motion is
    small. Of a servo, the position's noise is in the effort, and the acceleration's partly makes up for it.
    """
    joint = replace(NOISY, drive=drive, gain=gain, period=5e-3, duration=20.0, encoder_step=2e-3, encoder_noise=1e-3)
    rig = parse_rig({"joint": "joint", "drive": drive, "load": {"unknown": "smooth"}, "drive_gain": joint.gain})
    load = Term(SMOOTH_LOADS[0], {"curve_start": -0.3, "curve_end": 0.3})
    found = []
    for seed in range(8):
        samples = build_samples([hung(joint, seed, FAST)], rig, "joint")
        columns = Columns(samples, declared_gain=joint.gain)
        fitted = fit(columns, [*terms("viscous", "coulomb"), load])
        found.append((fitted.beta[[1, 2, -1]], attenuation(columns, fitted)[[1, 2, -1]]))
    beta, moved = np.mean(found, axis=0)
    true = np.array([joint.viscous, joint.coulomb, joint.inertia + 0.5])
    assert abs(true - beta)[-1] > 0.03 * true[-1]
    assert (true - beta)[-1] == pytest.approx(moved[-1], rel=0.4)


class Still(TorqueEffect):
    """An effect that never acts in these rows."""

    id = "still"
    title = "still"
    kind = "load"
    coefficients = (Parameter("still", "N*m"),)
    signature = Signature("time", "", "nothing")
    linear = True

    def columns(self, signals, shape):
        return np.zeros((len(signals), 1))


def test_a_column_of_zeros_moves_nothing():
    columns = noisy(0)
    moved = attenuation(columns, fit(columns, [*terms(*DECLARED), Term(Still())]))
    assert moved[:-1] == pytest.approx(attenuation(columns, fit(columns, terms(*DECLARED))))
    assert moved[-1] == 0.0


def test_nothing_is_moved_where_every_coefficient_rests_on_a_bound():
    columns = noisy(0).changed(declared_gain=NOISY.gain)
    fitted = fit(columns, terms(*DECLARED))
    resting = replace(fitted, beta=fitted.beta * np.array([1.0, 0.0, 0.0, 0.0]))
    assert not attenuation(columns, resting).any()


def test_nothing_is_moved_where_the_inertia_is_declared_with_its_value():
    columns = noisy(0)
    assert attenuation(columns, fit(columns, terms("viscous", "coulomb"))) is None


def test_intervals_hold_the_truth_that_the_noise_moves_the_estimate_from():
    result = diagnosed(NOISY, FAST, declared=["rotor_inertia"])
    assert result.effects == ()
    truth = {"drive": NOISY.gain, "viscous": NOISY.viscous, "coulomb": NOISY.coulomb, "rotor_inertia": NOISY.inertia}
    for key, value in truth.items():
        (estimate,) = result.final_parameters[key].values()
        assert estimate.ci95[0] <= value <= estimate.ci95[1]
        assert abs(estimate.value - value) > 0.02 * value
