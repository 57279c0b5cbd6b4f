"""Margins against python-control and closed forms."""

import json
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.control.stability_margins import frequency_grid, margins
from drake_tc.errors import ParamsError

DT = 0.05
SYSTEMS = {
    "integrator with lag": ([4.0], [0.2, 1.0, 0.0], 0),
    "third order": ([8.0], [1.0, 3.0, 3.0, 1.0], 0),
    "lightly damped": ([30.0], [1.0, 0.8, 40.0, 0.0], 0),
    "delayed": ([3.0], [1.0, 0.0], 12),
}
"""Numerator and denominator in s, and ticks of delay."""
PYTHON_CONTROL = """
import json, sys
import control
found = {}
for name, (numerator, denominator, ticks) in json.loads(sys.argv[1]).items():
    system = control.sample_system(control.tf(numerator, denominator), DT, "zoh")
    system = system * control.tf([1.0], [1.0] + [0.0] * ticks, DT)
    margins = control.stability_margins(system, returnall=True, method="poly")
    found[name] = [system.num[0][0].tolist(), system.den[0][0].tolist(), [list(map(float, m)) for m in margins]]
print(json.dumps(found))
""".replace("DT", repr(DT))


@pytest.fixture(scope="module")
def references():
    """By python-control, in a process of its own: here `control` is the folder of our own tests."""
    arguments = [sys.executable, "-I", "-c", PYTHON_CONTROL, json.dumps(SYSTEMS)]
    return json.loads(subprocess.run(arguments, check=True, capture_output=True, text=True).stdout)


@pytest.mark.parametrize("name", SYSTEMS)
def test_margins_are_those_of_python_control(name, references):
    numerator, denominator, listed = references[name]
    gains, phases, distances, at_phase, at_gain, _ = map(np.array, listed)

    def response(omega):
        z = np.exp(1j * omega * DT)
        return np.polyval(numerator, z) / np.polyval(denominator, z)

    found = margins(response, DT)
    nearest, smallest = np.argmin(np.abs(np.log(gains))), np.argmin(np.abs(phases))
    assert_allclose(found.gain_margin, gains[nearest], rtol=1e-6)
    assert_allclose(found.phase_crossover, at_phase[nearest], rtol=1e-6)
    assert_allclose(found.phase_margin, np.radians(phases[smallest]), rtol=1e-6)
    assert_allclose(found.crossover, at_gain[smallest], rtol=1e-6)
    late = np.min(np.radians(np.where(phases > 0.0, phases, phases + 360.0)) / at_gain)
    assert_allclose(found.delay_margin, late, rtol=1e-6)
    assert distances.size
    assert_allclose(found.sensitivity_peak, 1.0 / np.min(distances), rtol=1e-6)


def test_the_delay_margin_is_the_delay_at_which_the_loop_oscillates():
    """A pure integrator k/s with a delay T oscillates at omega = k, k T = pi/2."""
    found = margins(lambda omega: 5.0 / (1j * omega), 1e-3)
    assert_allclose(found.delay_margin, np.pi / 2.0 / 5.0, rtol=1e-9)
    assert_allclose(found.phase_margin, np.pi / 2.0, rtol=1e-9)
    assert_allclose(found.sensitivity_peak, 1.0, rtol=1e-5)  # its distance to -1 falls to 1 at infinite frequency
    border = margins(lambda omega: 5.0 / (1j * omega) * np.exp(-1j * omega * found.delay_margin), 1e-3)
    assert_allclose(border.phase_margin, 0.0, atol=1e-9)
    assert_allclose(border.gain_margin, 1.0, rtol=1e-9)


def test_a_loop_that_never_crosses_has_no_margins():
    found = margins(lambda omega: 0.5 / (1.0 + 1j * omega), DT)
    assert found.gain_margin == np.inf and found.phase_margin == np.inf and found.delay_margin == np.inf
    assert np.isnan(found.crossover)


def test_refusals():
    with pytest.raises(ParamsError, match="expected a positive period"):
        margins(lambda omega: 1.0 / omega, 0.0)
    with pytest.raises(ParamsError, match="expected a finite response"):
        margins(lambda omega: np.full(omega.shape, np.nan + 0j), DT)
    assert frequency_grid(DT)[-1] == pytest.approx(np.pi / DT)
