"""Columns of contradicting signs are refused; columns that agree, whatever their direction, are not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.drive_gain import require_consistent_signs, tells_drive_gain
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.effects.library import effect
from drake_tc.errors import IdentificationError
from drake_tc.logs.record import Run

from ..rigs import COMMAND, Joint, Motion, motion, record, rig_of, servo, sines

TERMS = (Term(effect("viscous")), Term(effect("coulomb")))
NOISY = Joint(torque_noise=0.3)


def check(joint: Joint, flipped: tuple[str, ...] = (), seed: int = 0) -> None:
    """Fit the declared model to a log with flipped columns and check its signs."""
    made = record(joint, seed=seed)
    columns = {n: -x if n.rpartition("/")[2] in flipped else x for n, x in made.columns.items()}
    samples = Columns(build_samples([replace(made, columns=columns)], rig_of(joint), "joint"))
    require_consistent_signs(samples, fit(samples, TERMS), rig_of(joint), "joint")


@pytest.mark.parametrize("drive", ["current", "voltage"])
def test_consistent_signs_pass_in_both_directions_of_the_joint(drive):
    joint = replace(NOISY, drive=drive)
    check(joint)
    check(joint, ("position", "torque", COMMAND[drive]))
    check(servo(torque_noise=0.3), ("position", "torque", "position_command"))


@pytest.mark.parametrize("joint", [NOISY, replace(NOISY, drive="voltage"), servo(torque_noise=0.3)])
def test_a_torque_of_the_wrong_sign_is_refused_by_name_with_the_repair(joint):
    with pytest.raises(IdentificationError, match=r"joint joint: .*torque: -N\*m") as caught:
        check(joint, ("torque",))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("drive", ["current", "voltage"])
def test_a_command_of_the_wrong_sign_is_refused(drive):
    with pytest.raises(IdentificationError, match=rf"joint joint: .*{drive}"):
        check(replace(NOISY, drive=drive), (drive,))


@pytest.mark.parametrize("seed", range(5))
def test_a_load_that_says_nothing_is_left_to_the_fit(seed):
    """Pure noise as torque correlates with nothing: its sign is no evidence."""
    made = record(NOISY, seed=seed)
    rng = np.random.default_rng(seed)
    silent = {**made.columns, "joint/torque": 0.05 * rng.standard_normal(len(made))}
    m = record(replace(NOISY, torque_noise=0.0)).columns
    without = m["joint/current"] - NOISY.gain * m["joint/torque"]
    columns = {**silent, "joint/current": without}
    samples = Columns(build_samples([replace(made, columns=columns)], rig_of(NOISY), "joint"))
    require_consistent_signs(samples, fit(samples, TERMS), rig_of(NOISY), "joint")


def mostly_friction(switch: float, viscous: float = 10.0) -> tuple[Run, Joint]:
    """A servo whose friction exceeds its load, which is not zero on average, with a gain that depends on direction."""
    joint = Joint(drive="position_servo", gain=2e-3, viscous=viscous, coulomb=20.0)
    m = motion(joint)
    torque = 0.3 * m.tau - 3.0
    need = torque + joint.inertia * m.a + joint.viscous * m.v + joint.coulomb * np.sign(m.v)
    effort = joint.gain * need * (1.0 + switch * np.sign(m.v))
    made = record(joint)
    return replace(made, columns=made.columns | {"joint/torque": torque, "joint/position_command": m.q + effort}), joint


def looking_for(*keys: str) -> DiagnosisOptions:
    return DiagnosisOptions(effects=tuple(effect(key) for key in keys), assess_residual=False)


def columns_of(made: Run, joint: Joint) -> Columns:
    return Columns(build_samples([made], rig_of(joint), "joint"))


def test_a_missing_effect_larger_than_the_load_is_no_wrong_sign():
    made, joint = mostly_friction(switch=0.14)
    columns = columns_of(made, joint)
    declared = fit(columns, TERMS)
    assert not tells_drive_gain(columns, declared)
    require_consistent_signs(columns, declared, rig_of(joint), "joint")


@pytest.mark.slow
@pytest.mark.xfail(strict=True, reason="the declared fit has no gain, and is not told at the final one")
def test_the_missing_effect_is_found_and_both_models_are_told_at_its_drive_gain():
    made, joint = mostly_friction(switch=0.14)
    found = diagnose_joint([made], [], rig_of(joint), "joint", looking_for("velocity_sign_switch", "quadratic_viscous"))
    assert [e.id for e in found.effects] == ["velocity_sign_switch"]
    assert found.final.gain == pytest.approx(joint.gain * (1.0 - 0.14**2), rel=1e-3)  # K of 1/K (1 -+ a)
    assert found.baseline.gain == pytest.approx(found.final.gain)
    friction = found.baseline_parameters
    assert friction["viscous"]["viscous"].value > 0.5 * joint.viscous  # in its own fit both are 0
    assert friction["coulomb"]["coulomb"].value > 0.5 * joint.coulomb


def test_a_load_that_explains_nothing_of_the_effort_is_refused():
    made, joint = mostly_friction(switch=0.4, viscous=60.0)
    columns = columns_of(made, joint)
    with pytest.raises(IdentificationError, match="drive gain not identifiable"):
        require_consistent_signs(columns, fit(columns, TERMS), rig_of(joint), "joint")


@pytest.mark.parametrize("turned", ["joint/torque", "joint/current"])
@pytest.mark.parametrize(("load", "source"), [("links", "robot's model"), ("pendulum", "pendulum")])
def test_a_computed_load_has_no_torque_column_that_could_be_turned(turned, load, source):
    made = record(NOISY)
    columns = made.columns | {turned: -made.columns[turned]}
    rows = Columns(build_samples([replace(made, columns=columns)], rig_of(NOISY), "joint"))
    with pytest.raises(IdentificationError, match=r"units: \{joint/current: -A\}") as caught:
        require_consistent_signs(rows, fit(rows, TERMS), rig_of(NOISY), "joint", load)
    assert source in str(caught.value) and "-N*m" not in str(caught.value)


@pytest.mark.parametrize(
    ("written", "repair"),
    [("-A", "joint/current: A}"), ("mA", "joint/current: -mA}"), ("-mA", "joint/current: mA}"), (-0.02, "t: 0.02}")],
)
def test_the_repair_turns_the_unit_that_the_rig_file_states(written, repair):
    """The logs are in SI after reading, so only the rig file tells how its column is turned."""
    made = record(NOISY)
    columns = made.columns | {"joint/current": -made.columns["joint/current"]}
    rows = Columns(build_samples([replace(made, columns=columns)], rig_of(NOISY), "joint"))
    for units in ({"current": written}, {"joint/current": written}):
        rig = replace(rig_of(NOISY), units=units | {"position": "deg"})
        with pytest.raises(IdentificationError, match="reverse the current") as caught:
            require_consistent_signs(rows, fit(rows, TERMS), rig, "joint", "links")
        assert repair in str(caught.value)
        assert "joint/position: -deg" in str(caught.value)


def with_integral_action(rate: float) -> tuple[Run, Joint]:
    """A pendulum on a servo with y + rate int y dt = K (tau + ...), by the bilinear transform of s/(s + rate)."""
    joint = servo(inertia=0.05, viscous=0.2, coulomb=1.0, duration=20.0)
    time = joint.times()
    q, v, a = sines(time, ((0.11, 0.6, 0.0), (0.17, 0.4, 0.9)), 0.0)
    m = Motion(time, q, v, a, 8.0 * np.sin(q))
    need = joint.gain * (m.tau + joint.inertia * m.a + joint.viscous * m.v + joint.coulomb * np.sign(m.v))
    half = 0.5 * rate * joint.period
    at_start = need[:1] * (1.0 - 1.0 / (1.0 + half))  # the integral is 0, and the effort is the need
    effort = lfilter([1.0, -1.0], [1.0 + half, half - 1.0], need, zi=at_start)[0]
    torque = m.tau + 0.1 * np.random.default_rng(0).standard_normal(time.size)
    columns = {"joint/position": m.q, "joint/torque": torque, "joint/position_command": m.q + effort}
    return joint.run("run", columns), joint


@pytest.mark.slow
@pytest.mark.xfail(strict=True, reason="counts as distorted, and rows that count alike do not show it")
def test_a_strong_integral_action_is_no_wrong_sign_and_is_found():
    """Its integral rate is above the frequencies of the motion, and the effort does not rise with the load."""
    rate = 8.0
    made, joint = with_integral_action(rate)
    columns = columns_of(made, joint)
    assert not tells_drive_gain(columns, fit(columns, TERMS))
    found = diagnose_joint([made], [], rig_of(joint), "joint", looking_for("servo_integrator", "delay.command"))
    (integrator,) = found.effects
    assert integrator.id == "servo_integrator"
    assert integrator.parameters["integral_rate"].value == pytest.approx(rate, rel=0.02)
    assert found.final.gain == pytest.approx(joint.gain, rel=0.02)


@pytest.mark.parametrize("rate", [0.5, 2.0, 4.0])
def test_a_wrong_sign_is_refused_also_where_integral_action_is_missing(rate):
    made, joint = with_integral_action(rate)
    columns = columns_of(replace(made, columns=made.columns | {"joint/torque": -made.columns["joint/torque"]}), joint)
    with pytest.raises(IdentificationError, match=r"torque: -N\*m"):
        require_consistent_signs(columns, fit(columns, TERMS), rig_of(joint), "joint")
