"""All rows, by theme."""

from . import drive, faults, friction, gear, load, robots, sensors, speed_only, timing
from .case import Case

CASES: tuple[Case, ...] = tuple(
    case for theme in (timing, friction, drive, load, sensors, gear, speed_only, faults, robots) for case in theme.CASES
)
WRONG: frozenset[str] = frozenset(
    {
        "drive: a constant torque beside a load 3 % too large",
        "drive: a fitted rotor, noise of 0.1 steps",
        "drive: a fitted rotor, noise of 0.3 steps",
        "drive: a fitted rotor, noise of 1.0 steps",
        "drive: a torque drive of another scale than declared",
        "drive: an undeclared rotor at 50 Hz",
        "drive: an undeclared rotor at 50 Hz, four held-out runs",
        "drive: an undeclared rotor beside a known gain",
        "drive: currents averaged over a period of 10 ms",
        "drive: integral action above the frequencies of the motion",
        "faults: a torque of the right sign of a noisy sensor",
        "faults: degrees declared as radians are refused",
        "friction: a gear that is hard to back-drive",
        "friction: a load over the position",
        "friction: a torque constant that falls as the joint warms",
        "friction: a torque of position and speed under a small pendulum",
        "friction: grows with the torque on the motor's side",
        "gear: a link that swings at 7 Hz on a soft gear is no late sensor",
        "gear: a link that swings at 7 Hz on a soft gear, its torque measured",
        "gear: a motor ahead of its encoder by the wind-up is no late sensor",
        "gear: a position logged 12 ms late beside a torque sensor is no payload",
        "gear: play beside a spring of the link",
        "gear: play of 0.6 mrad",
        "gear: play of 1.2 mrad",
        "gear: play of 2 mrad",
        "load: a pendulum heavier than declared",
        "load: unknown without a scale, position servo",
        "load: unknown, position servo",
        "robots: a delay of all joints is named once",
        "robots: a delay of one joint is its own",
        "robots: a late encoder is told by the other joints",
        "robots: commands of servos and an effect of one joint",
        "robots: held commands of servos and an effect of one joint",
        "robots: servos of unknown gain",
        "sensors: a bias larger than a walk",
        "sensors: a scale of six tolerances",
        "sensors: a wave of an encoder below one of its steps",
        "sensors: coloured noise of a torque",
        "sensors: more noise of a torque than is declared",
        "sensors: noise of the position of a current, 1 to 5 Hz",
        "sensors: white noise of a current",
        "sensors: white noise of a torque under a servo",
        "set-up: friction that grows with the load is no torque constant",
        "timing: a current three periods late",
        "timing: a goal held for 20 ms adds no inertia",
        "timing: a goal logged before it is written is no delay",
        "timing: a goal one cycle late beyond its hold",
        "timing: a late goal and an undeclared rotor are told from a lag",
        "timing: a torque with spikes from a topic of 60 Hz in a log of 200 Hz",
        "timing: half a hold of a goal at 500 Hz is no delay",
        "timing: the same goal is late where the rig file states the hold",
    }
)
"""Rows that are known to be answered wrongly: expected failures, and to be shortened."""
QUICK: frozenset[str] = (
    frozenset(
        {
            "timing: a goal logged after it was written is no delay",
            "load: smooth",
            "sensors: the zero of a current of six tolerances",
        }
    )
    | {case.name for case in CASES if case.refusal} - WRONG
)
"""Three rows, and what is refused. `make test` runs their first seeds; all else is slow."""
