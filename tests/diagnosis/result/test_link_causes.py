"""What else may be behind the mass of a link: a tool in all logs."""

from dataclasses import replace

import pytest
from fitted_arm import JOINTS, URDF, rig_file
from robot_files import joint_tag, link_tag, write_robot

from drake_tc.diagnosis.notes import LoadInAllRuns
from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.result.rig_result import SharedEffect
from drake_tc.diagnosis.run import link_notes
from drake_tc.estimation.robot_loads import robot_logs
from drake_tc.logs.rig import load_rig
from drake_tc.report.notes import note_sentence

FINGER = link_tag("finger", (0, 0, 0), 0.015, (1e-6, 1e-6, 1e-6)) + joint_tag(
    "grip", "fore", "finger", xyz=(0.3, 0, 0), axis=(0, 0, 1), kind="fixed"
)


def cause(name: str, where: str, **values: float) -> SharedEffect:
    found = {key: Estimate(value, "", (value, value), False) for key, value in values.items()}
    return SharedEffect(name, where, name, found, 0.5, 1.0, {})


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    write_robot(folder, URDF.replace("</robot>", f"{FINGER}</robot>"), JOINTS)
    return robot_logs(load_rig(rig_file(folder, load={"robot": "inverse_dynamics"})), [])


def test_a_mass_larger_than_the_link_may_be_a_load(logs):
    notes = link_notes([cause("link_mass", "finger", mass=0.87), cause("link_mass", "fore", mass=0.36)], logs)
    assert notes == (LoadInAllRuns("finger", 0.87, 0.015),)
    assert link_notes([cause("link_mass", "finger", mass=2350.0)], logs) == ()
    assert "at finger, 0.87 kg, is larger than the link's own (0.015 kg)" in note_sentence(notes[0])


def test_nothing_is_said_without_such_a_cause_or_with_an_imu(logs):
    heavy = [cause("link_mass", "finger", mass=0.87)]
    assert link_notes([cause("ft_bias", "foot")], logs) == () == link_notes(heavy, None)
    assert link_notes(heavy, replace(logs, reads_imu=True)) == ()
