"""Goals that somebody steps from one to the next are no noise, and a channel of a slower topic still has its noise."""

import numpy as np
import pytest

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.logs.rig import parse_rig

from ..rigs import Joint, record

LOAD = {"load": "unknown", "drive_gain": 0.1}


def effort_noise(drive: str, values: np.ndarray) -> float:
    """As the samples of a log show it whose command has these values."""
    joint = Joint(drive=drive, period=2e-3, duration=2e-3 * values.size)
    made = record(joint, "run", 0.0)
    made.columns[f"joint/{'position_command' if drive == 'position_servo' else drive}"][:] = values
    return build_samples([made], parse_rig({"joint": "joint", "drive": drive, **LOAD}), "joint").resolution.effort_noise


@pytest.mark.parametrize(("drive", "seconds"), [("position_servo", 0.1), ("position_servo", 1.0), ("voltage", 1.0)])
def test_random_steps_of_a_command_are_no_noise(drive: str, seconds: float):
    rows = round(seconds / 2e-3)
    assert effort_noise(drive, np.repeat(np.random.default_rng(1).uniform(-1.0, 1.0, 10000 // rows), rows)) == 0.0


@pytest.mark.parametrize("drive", ["position_servo", "current"])
def test_noise_of_a_slower_topic_counts_as_densely_as_it_is(drive: str):
    """Values that are held over h rows have h times the density of white noise at low frequencies."""
    noise, rows = 0.02, 10
    values = np.sin(np.arange(1000) * 0.02) + noise * np.random.default_rng(2).standard_normal(1000)
    assert effort_noise(drive, np.repeat(values, rows)) == pytest.approx(noise * np.sqrt(rows), rel=0.15)
