"""A motor from four numbers and a data sheet: what the intervals promise, and what they do not."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_tc.actuation.plant import VoltageMotor
from drake_tc.errors import IdentificationError
from drake_tc.identification.motor_prior import UNKNOWNS, PriorWidths, _with_prior, identify_motor
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

SHEET = VoltageMotor(0.043, 0.043, 0.55, 1.0e-5, 100.0, 3.0, 2.0, 200.0, 24.0)
WIDTHS = PriorWidths(coulomb=1.0, viscous=0.6)


def told_by(motor):
    """The four numbers of a motor by the data sheet's equations."""
    gain = motor.volts_per_torque
    return gain * np.array([1.0, motor.damping, motor.coulomb, motor.inertia])


def drawn(rng):
    """A motor as its prior says: kt, Rm and Jm log-normal, ke with kt."""
    share = np.exp([getattr(WIDTHS, name) * rng.standard_normal() for name in UNKNOWNS[:3]])
    constant, resistance, inertia = share * [SHEET.torque_constant, SHEET.resistance, SHEET.rotor_inertia]
    coulomb = SHEET.coulomb + WIDTHS.coulomb * rng.standard_normal()
    viscous = SHEET.viscous + WIDTHS.viscous * rng.standard_normal()
    rest = (SHEET.gear_ratio, max(coulomb, 0.0), max(viscous, 0.0), SHEET.stiffness)
    return VoltageMotor(constant, constant, resistance, inertia, *rest)


def fitted(z, deviation, sheet=SHEET, widths=WIDTHS):
    fit = SimpleNamespace(coefficients=z, hac_covariance=np.diag(deviation**2))
    return _with_prior("elbow", fit, sheet, widths)


@pytest.mark.slow
def test_95_percent_intervals_hold_the_truth_in_95_percent_of_the_cases():
    """Truth drawn from the prior, logs of 2 % noise: 600 draws leave 0.9 % of scatter in a share of 0.95."""
    rng, number = np.random.default_rng(1), 600
    inside = np.zeros(5)
    for _ in range(number):
        motor = drawn(rng)
        numbers = told_by(motor)
        deviation = 0.02 * numbers
        spread = np.hypot(deviation, WIDTHS.model * numbers)
        found = fitted(numbers + spread * rng.standard_normal(4), deviation)
        inside += [found.spread[name][0] <= getattr(motor, name) <= found.spread[name][1] for name in UNKNOWNS]
    share = inside / number
    assert (share > 0.92).all(), dict(zip(UNKNOWNS, share, strict=True))
    assert (share < 0.99).all(), dict(zip(UNKNOWNS, share, strict=True))


def test_the_pull_is_how_far_the_truth_was_off_the_sheet():
    """Exact logs of a motor whose inertia alone is two deviations off: that unknown says so, no other does."""
    motor = SHEET.scaled(rotor_inertia=float(np.exp(2.0 * WIDTHS.rotor_inertia)))
    numbers = told_by(motor)
    found = fitted(numbers, 1e-4 * numbers)
    assert found.pull["rotor_inertia"] == pytest.approx(2.0, abs=0.01)
    assert max(abs(found.pull[name]) for name in UNKNOWNS if name != "rotor_inertia") < 0.02
    assert found.cost == pytest.approx(4.0, abs=0.05)  # two deviations, squared
    assert found.notes == ()


def test_a_sheet_that_is_doubtful_is_told_and_one_that_is_wrong_is_refused():
    far = SHEET.scaled(rotor_inertia=float(np.exp(4.0 * WIDTHS.rotor_inertia)))
    found = fitted(told_by(far), 1e-4 * told_by(far))
    assert "rotor_inertia is +4.0 deviations off the data sheet" in found.notes[0]
    other_gear = VoltageMotor(**{**vars(SHEET), "gear_ratio": 1.0})
    with pytest.raises(IdentificationError, match=r"contradict .*rotor_inertia is \+\d+\.\d deviations off"):
        fitted(told_by(SHEET), 1e-3 * told_by(SHEET), other_gear)


def test_a_sheet_whose_two_constants_differ_is_told():
    odd = SHEET.scaled(back_emf=0.5)
    found = fitted(told_by(odd), 1e-3 * told_by(odd), odd)
    assert "back_emf is 0.5 of its torque_constant" in found.notes[0]


def recorded(motor, ripple, seconds=6.0, dt=1e-3):
    """Runs of a motor by its equation, with a torque of `ripple` [N m] at 60 cycles a turn that no model declares."""
    rng, t = np.random.default_rng(3), np.arange(round(seconds / dt)) * dt
    runs = []
    for i, (hz, size) in enumerate(((0.7, 0.6), (1.7, 0.3), (0.3, 0.8))):
        q, w = size * np.sin(2.0 * np.pi * hz * t), 2.0 * np.pi * hz
        v, a = size * w * np.cos(w * t), -(w**2) * q
        pull = 12.0 * np.sin(2.0 * np.pi * 0.31 * t + i)
        lost = motor.damping * v + motor.coulomb * np.sign(v) + motor.inertia * a + ripple * np.sin(60.0 * q)
        columns = {"j/position": np.round(q / 1.5e-5) * 1.5e-5, "j/voltage": motor.volts_per_torque * (pull + lost)}
        columns["j/torque"] = pull + 0.02 * rng.standard_normal(t.size)
        runs.append(Run(f"run{i}", None, t, dt, columns, np.zeros(t.size, dtype=np.int64)))
    return runs


def test_an_interval_is_not_of_what_the_model_lacks():
    """Where the model is the truth it holds it, to 0.5 %; a ripple moves Jm by 6 %, far out of it."""
    truth = SHEET.scaled(rotor_inertia=1.1)
    rig = parse_rig({"joints": ["j"], "drive": "voltage", "load": "torque"})
    plain, rippled = (identify_motor(recorded(truth, ripple), rig, SHEET, widths=WIDTHS) for ripple in (0.0, 0.6))
    low, high = plain.spread["rotor_inertia"]
    assert low <= truth.rotor_inertia <= high
    assert plain.motor.rotor_inertia == pytest.approx(truth.rotor_inertia, rel=5e-3)
    low, high = rippled.spread["rotor_inertia"]
    assert not low <= truth.rotor_inertia <= high
    assert 0.04 < abs(rippled.motor.rotor_inertia / truth.rotor_inertia - 1.0) < 0.09
