"""The motion of a held-out run as a reference: its liveliest stretch, begun and ended at rest, as knots."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.loops.scenarios.parts import MotionSpec
from drake_tc.types import FloatArray

KNOT = 0.05
"""Between knots [s]."""
RAMP = 0.5
"""Over which the motion comes up to its own speed, and slows down again [s]."""


@dataclass(frozen=True)
class HeldOutMotion:
    """A reference and where it comes from.

    Attributes:
        spec: Knots.
        run: Name of the run. start, end: of the stretch in it [s].
        begin, finish: When the reference moves [s].
    """

    spec: MotionSpec
    run: str
    start: float
    end: float
    begin: float
    finish: float


def held_out_motion(samples: Mapping[str, Samples], longest: float, lead: float) -> HeldOutMotion | None:
    """The stretch of at most `longest` [s] in which the joints move most, each measured by its own speed.

    Args:
        samples: Joint to its held-out side; all of one clock.
        longest: Of the stretch [s].
        lead: Rest before it [s].

    Returns:
        None where no stretch is as long as a second.
    """
    first = next(iter(samples.values()))
    period = first.signals.period
    speed = np.zeros(len(first.signals))
    for each in samples.values():
        own = np.abs(each.signals.velocity)
        speed += own / max(float(own.mean()), 1e-12)
    best: tuple[float, slice] | None = None
    for segment in first.segments:
        margin = max(each.light.margin for each in samples.values())
        begin, stop = segment.start + margin, segment.stop - margin
        size = min(round(longest / period), stop - begin)
        if size * period < 1.0:
            continue
        total = np.concatenate([[0.0], np.cumsum(speed[begin:stop])])
        sums = total[size:] - total[:-size]
        at = int(np.argmax(sums))
        if best is None or sums[at] > best[0]:
            best = (float(sums[at]), slice(begin + at, begin + at + size))
    if best is None:
        return None
    part = best[1]
    time = (np.arange(part.stop - part.start)) * period
    times, progress = eased(float(time[-1]))
    knots = {joint: _knots(each.signals.position[part], time, progress) for joint, each in samples.items()}
    clock = first.signals.time[part]
    spec = MotionSpec(
        posture={joint: values[0] for joint, values in knots.items()},
        times=tuple(float(t) for t in times + lead),
        knots=knots,
    )
    run = first.runs[int(first.run_of_sample[part.start])]
    return HeldOutMotion(spec, run, float(clock[0]), float(clock[-1]), lead, lead + float(times[-1]))


def eased(duration: float) -> tuple[FloatArray, FloatArray]:
    """(times of knots, places s in the stretch) [s], with ds/dt risen to 1 and fallen to 0 over `RAMP`."""
    ramp = min(RAMP, 0.5 * duration)
    count = max(2, round((duration + ramp) / KNOT) + 1)
    times = np.linspace(0.0, duration + ramp, count)
    fine = np.linspace(0.0, duration + ramp, 20 * count)
    rise = np.clip(np.minimum(fine, fine[-1] - fine) / ramp, 0.0, 1.0)
    rate = rise**3 * (10.0 - 15.0 * rise + 6.0 * rise**2)
    places = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(fine))])
    return times, np.asarray(np.interp(times, fine, places * duration / places[-1]))


def _knots(position: FloatArray, time: FloatArray, places: FloatArray) -> tuple[float, ...]:
    """Means over the time between knots: what the knots cannot follow must not be folded into them."""
    period = float(time[1] - time[0])
    box = max(1, round(KNOT / period)) | 1
    padded = np.pad(position, box // 2, mode="edge")
    smooth = np.convolve(padded, np.full(box, 1.0 / box), mode="valid")
    return tuple(float(q) for q in np.interp(places, time, smooth))
