"""A servo's integral that holds a load when the log begins is found as well as one that begins at zero."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from drake_tc.diagnosis.joint import diagnose_joint
from drake_tc.diagnosis.notes import ChargedIntegrator
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, parse_rig

from ..rigs import Joint, record, rig_of, servo

pytestmark = pytest.mark.slow

RATE = 1.5
JOINT = servo(torque_noise=0.05)
HANGING = replace(JOINT, encoder_noise=5e-5, extra=lambda m: 8.0 * np.sin(m.q) + 0.3 * m.a - m.tau)
"""Without the hand that pushes the other joint: a pendulum of 8 N m and 0.3 kg m^2."""


def integrating(joint: Joint, name: str, shift: float, charge: float) -> Run:
    """y + RATE (I_0 + int y dt) = K (tau + ...), by the bilinear transform; RATE I_0 is `charge` first needs."""
    made = record(joint, name, shift)
    need = made.columns["joint/position_command"] - made.columns["joint/position"]
    half = 0.5 * RATE * joint.period
    need = need - charge * need[0]
    effort = lfilter([1.0, -1.0], [1.0 + half, half - 1.0], need, zi=need[:1] * (1.0 - 1.0 / (1.0 + half)))[0]
    return replace(made, columns=made.columns | {"joint/position_command": made.columns["joint/position"] + effort})


@pytest.mark.parametrize(("charges", "noted"), [((1.0, 1.6), True)])
def test_integral_action_is_found_whatever_the_integral_holds_at_first(charges, noted):
    runs = [integrating(JOINT, f"run{k}", 0.9 * k, charge) for k, charge in enumerate(charges)]
    found = diagnose_joint(runs, [], rig_of(JOINT), "joint", DiagnosisOptions(assess_residual=False))
    (integrator,) = found.effects
    assert integrator.id == "servo_integrator"
    assert integrator.parameters["integral_rate"].value == pytest.approx(RATE, rel=0.01)
    assert found.final.gain == pytest.approx(JOINT.gain, rel=0.01)
    assert found.final_parameters["viscous"]["viscous"].value == pytest.approx(JOINT.viscous, rel=0.05)
    assert any(isinstance(note, ChargedIntegrator) for note in found.notes) == noted


def unknown_load(form: str) -> Rig:
    """A servo of known stiffness under a load of this form."""
    return parse_rig({"joint": "joint", "drive": "position_servo", "load": {"unknown": form}, "drive_gain": JOINT.gain})


@pytest.mark.parametrize("form", ["pendulum"])
def test_it_is_found_under_a_load_of_which_nothing_is_known(form):
    """The constant of the fitted load is one number for all runs, and the charges are not."""
    runs = [integrating(HANGING, f"run{k}", 0.9 * k, charge) for k, charge in enumerate((1.0, 1.6))]
    found = diagnose_joint(runs, [], unknown_load(form), "joint", DiagnosisOptions(assess_residual=False))
    (integrator,) = found.effects
    assert integrator.id == "servo_integrator"
    assert integrator.parameters["integral_rate"].value == pytest.approx(RATE, rel=0.01)
    load = next(values for key, values in found.final_parameters.items() if key.startswith("unknown_load"))
    assert load["inertia"].value == pytest.approx(0.3 + JOINT.inertia, rel=0.01)  # the rotor is not declared
    if form == "pendulum":
        assert load["moment"].value == pytest.approx(8.0, rel=0.01)


def test_a_smooth_load_is_not_refused_where_no_integral_explains_what_is_left():
    """Splines less their means add up to zero: the trial must not take that for a motion that is too poor."""
    joint = replace(HANGING, extra=lambda m: HANGING.extra(m) + 2.0 * np.sign(np.sin(40.0 * m.q)))
    runs = [record(joint, f"run{k}", 0.9 * k) for k in range(2)]
    found = diagnose_joint(runs, [], unknown_load("smooth"), "joint", DiagnosisOptions(assess_residual=False))
    assert not any(isinstance(note, ChargedIntegrator) for note in found.notes)


def test_a_servo_without_integral_action_keeps_its_means():
    """A torque ripple that is not in the library's reach leaves more than the noise, and no integral explains it."""
    joint = replace(JOINT, extra=lambda m: 2.0 * np.sign(np.sin(40.0 * m.q)))
    runs = [record(joint, f"run{k}", 0.9 * k) for k in range(2)]
    found = diagnose_joint(runs, [], rig_of(joint), "joint", DiagnosisOptions(assess_residual=False))
    assert not any(isinstance(note, ChargedIntegrator) for note in found.notes)
