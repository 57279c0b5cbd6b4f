"""Columns of contradicting signs are refused; columns that agree, whatever their direction, are not."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.problem.signs import require_consistent_signs
from drake_tc.effects.library import effect
from drake_tc.errors import IdentificationError

from ..rigs import COMMAND, Joint, record, rig_of, servo

TERMS = (Term(effect("viscous")), Term(effect("coulomb")))
NOISY = Joint(torque_noise=0.3)


def check(joint: Joint, flipped: tuple[str, ...] = (), seed: int = 0) -> None:
    """Fit the declared model to a log with flipped columns and check its signs."""
    made = record(joint, seed=seed)
    columns = {n: -x if n.rpartition("/")[2] in flipped else x for n, x in made.columns.items()}
    samples = Columns(build_samples([replace(made, columns=columns)], rig_of(joint), "joint"))
    require_consistent_signs(samples, fit(samples, TERMS), "joint", joint.drive)


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
    require_consistent_signs(samples, fit(samples, TERMS), "joint", "current")


def test_a_gain_that_rests_at_nothing_is_refused():
    samples = Columns(build_samples([record(NOISY)], rig_of(NOISY), "joint"))
    fitted = fit(samples, TERMS)
    require_consistent_signs(samples, fitted, "joint", "current")
    nothing = replace(fitted, beta=np.array([1e-12, *fitted.beta[1:]]))
    with pytest.raises(IdentificationError, match="drive gain not identifiable"):
        require_consistent_signs(samples, nothing, "joint", "current")
