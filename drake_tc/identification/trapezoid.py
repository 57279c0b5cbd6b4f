"""The fastest move from rest to rest under a velocity and an acceleration limit."""

import numpy as np

from drake_tc.types import FloatArray


def trapezoid_duration(distance: float, velocity: float, acceleration: float) -> float:
    """Seconds that a move of `distance` [rad] takes at most `velocity` [rad/s] and `acceleration` [rad/s²].

    d/v + v/a when the top speed is reached (d >= v²/a), else 2 √(d/a).
    """
    d = abs(float(distance))
    top = min(velocity, float(np.sqrt(d * acceleration)))
    return d / top + top / acceleration if top > 0 else 0.0


def trapezoid(
    time: FloatArray, start: float, end: float, velocity: float, acceleration: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position [rad], velocity [rad/s], acceleration [rad/s²], each (T,), `time` [s] after the move began.

    Before 0 it rests at the start, after the duration at the end.
    """
    d, sign = abs(end - start), float(np.sign(end - start))
    total = trapezoid_duration(d, velocity, acceleration)
    top = min(velocity, float(np.sqrt(d * acceleration)))
    ramp = top / acceleration
    t = np.clip(time, 0.0, total)
    up, down = np.minimum(t, ramp), np.maximum(t - (total - ramp), 0.0)
    cruise = np.clip(t - ramp, 0.0, max(total - 2 * ramp, 0.0))
    position = 0.5 * acceleration * up**2 + top * cruise + top * down - 0.5 * acceleration * down**2
    moving = (time >= 0) & (time < total)
    speed = np.where(moving, acceleration * (up - down), 0.0)
    push = np.where(moving & (t < ramp), acceleration, 0.0) - np.where(moving & (t >= total - ramp), acceleration, 0.0)
    return start + sign * position, sign * speed, sign * push
