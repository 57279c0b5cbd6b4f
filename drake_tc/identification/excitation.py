"""Motions that excite a joint for identification, with exact derivatives, inside limits.

Source: Del Prete et al., 2016, section 3.

The fastest move from rest to rest under a velocity and an acceleration limit.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from drake_tc.errors import IdentificationError
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


@dataclass(frozen=True)
class MotionLimits:
    """What a joint may do.

    Attributes:
        position: (lowest, highest) [rad].
        velocity: Largest speed [rad/s].
        acceleration: Largest acceleration [rad/s²].

    Example:
        >>> MotionLimits((-1.0, 1.0), velocity=2.0, acceleration=20.0).velocity
        2.0
    """

    position: tuple[float, float]
    velocity: float
    acceleration: float

    def __post_init__(self) -> None:
        if not (self.position[0] < self.position[1] and self.velocity > 0 and self.acceleration > 0):
            raise IdentificationError(
                f"motion limits need lowest < highest position and positive velocity and acceleration, got {self}"
            )


@dataclass(frozen=True)
class Motion:
    """A joint's reference, every array (T,).

    Attributes:
        position: q [rad].
        velocity: q̇ [rad/s], the exact derivative.
        acceleration: q̈ [rad/s²], the exact second derivative.
        scale: By how much the desired amplitude was scaled to stay inside the limits.

    Example:
        >>> rest = np.zeros(3)
        >>> Motion(rest, rest, rest).scale
        1.0
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    scale: float = 1.0


def growing_sinusoid(
    time: FloatArray,
    frequency_hz: float,
    start: float,
    growth: float,
    limits: MotionLimits,
    centre: float = 0.0,
) -> Motion:
    """q(t) = c + s (a0 + a t) sin(2πft), s <= 1 the largest scale inside the limits.

    Args:
        time: (T,) [s].
        frequency_hz: f [Hz].
        start: a0 [rad].
        growth: a [rad/s].
        limits: Limits of the joint.
        centre: c [rad], inside the position limits.

    Raises:
        IdentificationError: A frequency that is not positive or a centre outside the limits.

    Source: Del Prete et al., 2016, section 3.4.

    Example:
        >>> limits = MotionLimits((-1.0, 1.0), velocity=2.0, acceleration=20.0)
        >>> motion = growing_sinusoid(np.arange(0.0, 5.0, 1e-3), 0.5, 0.1, 0.1, limits)
        >>> motion.scale, bool(np.abs(motion.velocity).max() <= limits.velocity)
        (1.0, True)
    """
    if not frequency_hz > 0:
        raise IdentificationError(f"growing sinusoid needs a positive frequency [Hz], got {frequency_hz:g}")
    omega = 2 * np.pi * frequency_hz
    amplitude, sine, cosine = start + growth * time, np.sin(omega * time), np.cos(omega * time)
    shape = (
        amplitude * sine,
        growth * sine + amplitude * omega * cosine,
        2 * growth * omega * cosine - amplitude * omega**2 * sine,
    )
    return _scaled(shape, centre, limits, fill=False)


def multisine(
    time: FloatArray,
    band_hz: tuple[float, float],
    tones: int,
    limits: MotionLimits,
    rng: np.random.Generator,
) -> Motion:
    """q(t) = s Σ_k cos(2π f_k (t + t0) + φ_k), φ_k = −π k (k − 1)/K: a low crest factor, scaled to the limits.

    The frequencies are whole multiples of 1/(length of `time`), spread evenly over the band, so the motion is
    periodic and its spectrum has no leakage; the generator draws t0, which turns every phase but keeps the crest.

    Args:
        time: (T,) [s], uniform.
        band_hz: (lowest, highest) frequency [Hz], below half the sampling rate.
        tones: Number of frequencies desired; fewer when the band does not hold as many multiples.
        limits: Limits of the joint; the largest scale that respects all of them is taken.
        rng: Source of t0.

    Raises:
        IdentificationError: A band without a multiple, or one beyond half the sampling rate.

    Source: Schroeder, IEEE Transactions on Information Theory 16 (1970).

    Example:
        >>> limits = MotionLimits((-1.0, 1.0), velocity=2.0, acceleration=20.0)
        >>> motion = multisine(np.arange(0.0, 10.0, 1e-3), (0.2, 2.0), 8, limits, np.random.default_rng(0))
        >>> bool(np.abs(motion.position).max() <= 1.0 + 1e-9)
        True
    """
    if time.size < 2 or tones < 1:
        raise IdentificationError(f"multisine needs two samples and one tone, got {time.size} and {tones}")
    period = (time[-1] - time[0]) * time.size / (time.size - 1)
    low, high = int(np.ceil(band_hz[0] * period - 1e-9)), int(np.floor(band_hz[1] * period + 1e-9))
    low = max(low, 1)
    if high < low or 2 * high >= time.size:
        raise IdentificationError(
            f"multisine band must hold a multiple of {1 / period:g} Hz below {0.5 * time.size / period:g} Hz; "
            f"got {band_hz[0]:g} to {band_hz[1]:g} Hz"
        )
    harmonics = np.unique(np.round(np.linspace(low, high, min(tones, high - low + 1))))
    k = np.arange(1, harmonics.size + 1)
    omega = 2 * np.pi * harmonics / period
    phase = -np.pi * k * (k - 1) / harmonics.size + omega * rng.uniform(0, period)
    shape = [np.zeros(time.size) for _ in range(3)]
    for w, p in zip(omega, phase, strict=True):
        sine, cosine = np.sin(w * time + p), np.cos(w * time + p)
        shape[0] += cosine
        shape[1] -= w * sine
        shape[2] -= w**2 * cosine
    return _scaled((shape[0], shape[1], shape[2]), 0.0, limits, fill=True)


def trapezoids(time: FloatArray, targets: Sequence[float], limits: MotionLimits, dwell_s: float = 0.0) -> Motion:
    """From target to target with trapezoidal velocity, at rest `dwell_s` on each; the last one is held.

    Args:
        time: (T,) [s].
        targets: Positions [rad], the first is where it starts.
        limits: Limits of the joint; each move is the fastest inside them.
        dwell_s: Rest on each target [s].

    Raises:
        IdentificationError: No target, one outside the position limits, or a negative rest.

    Example:
        >>> limits = MotionLimits((-1.0, 1.0), velocity=2.0, acceleration=20.0)
        >>> motion = trapezoids(np.arange(0.0, 4.0, 1e-3), (0.0, 0.8, -0.5), limits, dwell_s=0.2)
        >>> round(float(motion.position[-1]), 6)
        -0.5
    """
    _check_targets(targets, limits)
    if dwell_s < 0:
        raise IdentificationError(f"trapezoids need a rest >= 0 s, got {dwell_s:g}")
    q = np.full(time.size, float(targets[0]))
    v, a = np.zeros(time.size), np.zeros(time.size)
    begin = float(time[0]) + dwell_s
    for here, there in pairwise(targets):
        on = time >= begin
        q[on], v[on], a[on] = trapezoid(time[on] - begin, here, there, limits.velocity, limits.acceleration)
        begin += trapezoid_duration(there - here, limits.velocity, limits.acceleration) + dwell_s
    return Motion(q, v, a)


def postures_with_pushes(
    time: FloatArray,
    postures: Sequence[float],
    push_torque: float,
    pushes: int,
    limits: MotionLimits,
    rng: np.random.Generator,
) -> tuple[Motion, FloatArray]:
    """Static postures, each with slow external pushes of alternating sign: data for Kτ.

    A push is p sin²(π s), s from 0 to 1 over its share of the rest; p is drawn from 0.5 to 1 times `push_torque`.

    Args:
        time: (T,) [s]; what the moves leave of it is shared out evenly as rests.
        postures: Positions [rad].
        push_torque: Largest push [N·m].
        pushes: Pushes on each posture, >= 1.
        limits: Limits of the joint.
        rng: Source of the pushes' sizes and of the first sign.

    Returns:
        The motion and the external torque on the link (T,) [N·m].

    Raises:
        IdentificationError: No time left to rest, a posture outside the limits, or no push.

    Source: Del Prete et al., 2016, section 3.4.

    Example:
        >>> limits = MotionLimits((-1.0, 1.0), velocity=2.0, acceleration=20.0)
        >>> time, rng = np.arange(0.0, 12.0, 1e-3), np.random.default_rng(0)
        >>> motion, push = postures_with_pushes(time, (0.0, 0.5), 10.0, 2, limits, rng)
        >>> bool(5.0 <= np.abs(push).max() <= 10.0)
        True
    """
    _check_targets(postures, limits)
    moves = [trapezoid_duration(d, limits.velocity, limits.acceleration) for d in np.diff(postures)]
    rest = (float(time[-1] - time[0]) - sum(moves)) / len(postures)
    if pushes < 1 or rest <= 0:
        raise IdentificationError(
            f"postures need at least one push and time to rest, got {pushes} pushes, "
            f"moves of {sum(moves):g} s in {float(time[-1] - time[0]):g} s"
        )
    motion = trapezoids(time, postures, limits, dwell_s=rest)
    torque, begin, way = np.zeros(time.size), float(time[0]), float(rng.choice([-1.0, 1.0]))
    for move in [*moves, 0.0]:
        for i in range(pushes):
            s = (time - begin) * pushes / rest - i
            bump = np.where((s >= 0) & (s <= 1), np.sin(np.pi * s) ** 2, 0.0)
            torque += way * push_torque * rng.uniform(0.5, 1.0) * bump
            way = -way
        begin += rest + move
    return motion, torque


def _check_targets(targets: Sequence[float], limits: MotionLimits) -> None:
    low, high = limits.position
    outside = [float(t) for t in targets if not low <= t <= high]
    if outside or not targets:
        raise IdentificationError(f"targets expected in {low:g} to {high:g} rad; outside: {outside or 'none given'}")


def _scaled(
    shape: tuple[FloatArray, FloatArray, FloatArray], centre: float, limits: MotionLimits, *, fill: bool
) -> Motion:
    """Centre + s shape, with the largest s inside the limits, at most 1 unless it is to fill them."""
    low, high = limits.position
    if not low < centre < high:
        raise IdentificationError(f"centre expected in {low:g} to {high:g} rad, got {centre:g}")
    rooms = (
        (high - centre, shape[0].max()),
        (centre - low, -shape[0].min()),
        (limits.velocity, np.abs(shape[1]).max()),
        (limits.acceleration, np.abs(shape[2]).max()),
    )
    scale = min((room / size for room, size in rooms if size > 0), default=1.0)
    scale = float(scale if fill else min(scale, 1.0))
    return Motion(centre + scale * shape[0], scale * shape[1], scale * shape[2], scale)
