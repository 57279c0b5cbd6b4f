"""A pendulum on a current drive whose encoder is coarse: 12 bits, logged at 200 Hz. Closed forms, no simulation."""

from collections.abc import Callable

import numpy as np

from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

from .rigs import Logged, sines

STEP = 2.0 * np.pi / 4096
"""Of a 12-bit encoder [rad]."""
MASS, LENGTH, ROTOR, VISCOUS, COULOMB, GAIN = 1.2, 0.3, 0.02, 0.15, 0.35, 1.0 / 0.9
WAVES = ((0.31, 0.45, 0.0), (0.72, 0.25, 1.1), (1.13, 0.2, 2.3))
RIG = parse_rig({"joint": "joint", "drive": "current", "load": {"pendulum": {"mass": MASS, "length": LENGTH}}})


Extra = Callable[[np.ndarray, np.ndarray], np.ndarray]


def pendulum(shift: float, extra: Extra = lambda q, v: 0.0 * q) -> Run:
    """i = K ((J + m l^2) a + m g l sin q + F_v v + F_c sign v + extra(q, v)), with 20 mA of noise."""
    logged = Logged(period=5e-3, duration=30.0, encoder_step=STEP)
    rng = np.random.default_rng(7)
    q, v, a = sines(logged.times(), WAVES, shift)
    torque = (ROTOR + MASS * LENGTH**2) * a + MASS * 9.81 * LENGTH * np.sin(q) + VISCOUS * v + COULOMB * np.sign(v)
    current = GAIN * (torque + extra(q, v)) + 0.02 * rng.standard_normal(q.size)
    return logged.run(f"run{shift}", {"joint/position": logged.encoder(q, rng), "joint/current": current})
