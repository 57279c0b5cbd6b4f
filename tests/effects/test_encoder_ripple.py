"""The encoder ripple's column against the torque balance of a pendulum whose recorded angle wanders."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.effects.base import Context, plain_signals
from drake_tc.effects.encoder_ripple import EncoderRipple

MOMENT, LINK, ROTOR, VISCOUS = 3.0, 0.15, 0.002, 0.05
CYCLES, SINE, COSINE = 12.0, 4e-5, -7e-5


def balance(q: np.ndarray, dt: float) -> np.ndarray:
    """Torque that the motion q (T,) needs, by finite differences."""
    v = np.gradient(q, dt)
    return MOMENT * np.sin(q) + (LINK + ROTOR) * np.gradient(v, dt) + VISCOUS * v


def test_column_is_what_the_wandering_angle_takes_from_the_balance() -> None:
    dt = 1e-4
    t = np.arange(0.0, 3.0, dt)
    q = 1.4 * np.sin(2.1 * t) + 0.2 * np.sin(5.0 * t)
    wrong = q + SINE * np.sin(CYCLES * q) + COSINE * np.cos(CYCLES * q)
    v, a = np.gradient(wrong, dt), np.gradient(np.gradient(wrong, dt), dt)
    log = plain_signals(
        t.size, {"position": wrong, "velocity": v, "acceleration": a, "load_slope": MOMENT * np.cos(wrong)}
    )
    log = type(log)(**(vars(log) | {"rotor_inertia": ROTOR, "link_inertia": LINK, "viscous": VISCOUS}))
    effect = EncoderRipple()
    missing = effect.columns(log, {"cycles_per_turn": CYCLES}) @ np.array([SINE, COSINE])
    inner = slice(50, -50)
    off = (balance(q, dt) - balance(wrong, dt))[inner]
    assert np.ptp(off) > 0.01
    # first order in e: what is left is smaller by n |e| = 1e-3, and finite differences by (n v dt)^2
    assert_allclose(missing[inner], off, rtol=0.0, atol=5e-3 * np.abs(off).max())


@pytest.mark.parametrize("load", ["torque", "pendulum"])
def test_looked_for_only_where_the_load_comes_from_the_encoder(load: str) -> None:
    context = Context(drive="current", load=load, recorded=frozenset())  # type: ignore[arg-type]
    assert bool(EncoderRipple().obstacle(context)) == (load == "torque")


def test_grid_stays_below_what_the_sampling_shows() -> None:
    slow = Context(drive="current", load="pendulum", recorded=frozenset(), max_speed=10.0, period=0.02)
    largest = max(s["cycles_per_turn"] for s in EncoderRipple().shape_grid(slow))
    assert largest * 10.0 / (2 * np.pi) < 0.25 / 0.02
