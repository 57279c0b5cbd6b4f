"""All rows, by theme."""

from . import drive, faults, friction, gear, load, robots, sensors, speed_only, timing
from .case import Case

CASES: tuple[Case, ...] = tuple(
    case for theme in (timing, friction, drive, load, sensors, gear, speed_only, faults, robots) for case in theme.CASES
)
ENGINES: tuple[str, ...] = ("rules",)
"""Engines that the tests hold to the table."""
WRONG: dict[str, frozenset[str]] = {
    "rules": frozenset(
        {
            "timing: a continuous command at 100 Hz",
            "timing: goals 40 ms late beside another clock",
            "timing: a torque with spikes from a topic of 60 Hz in a log of 200 Hz",
            "friction: grows with the torque on the motor's side",
            "friction: a torque constant that falls as the joint warms",
            "drive: a servo with an inside at 500 Hz",
            "drive: a servo with an inside at 333 Hz",
            "drive: a servo with an inside under an unknown load",
            "drive: currents averaged over a period of 10 ms",
            "robots: fitted links beside drives that are commanded in torque",
            "robots: wrong links beside drives that are commanded in torque",
            "gear: soft teeth",
            "gear: a link that swings at 7 Hz on a soft gear is no late sensor",
            "gear: a motor ahead of its encoder by the wind-up is no late sensor",
            "drive: intervals of a noisy rotor",
            "sensors: a wave of an encoder below one of its steps",
            "faults: degrees declared as radians are refused",
            "faults: one constant speed is refused",
        }
    ),
}
"""Rows that an engine is known to answer wrongly, by engine: expected failures, and to be shortened."""
EVIDENCE: frozenset[str] = frozenset(
    {
        "timing: instants that scatter by 0.3 ms at 1 kHz",
        "friction: nothing is missing",
        "friction: quadratic",
        "friction: Stribeck",
        "friction: ripple and quadratic",
        "friction: only viscous friction differs by direction",
    }
)
"""Cases whose first seeds the fast tests ask of the engine `evidence`."""
QUICK: frozenset[str] = frozenset(
    {
        "timing: a goal logged after it was written is no delay",
        "timing: a command held at 100 Hz",
        "friction: nothing is missing",
        "friction: Stribeck",
        "friction: a random torque below 4 Hz",
        "drive: a dead zone",
        "drive: a supply that sags",
        "drive: a declared gain 12 % too small",
        "load: a pendulum lighter than declared",
        "load: smooth",
        "load: a run without a mass is refused",
        "load: a measured torque in mN m is refused",
        "sensors: a bias of five tolerances",
        "sensors: the zero of a current of six tolerances",
        "sensors: a torque that drifts",
        "gear: play of 1.2 mrad",
        "speed only: quadratic friction",
        "speed only: a pendulum asks for the position",
        "faults: one run with spike",
        "faults: one run, time backwards, is refused",
        "faults: a rig file without a drive is refused",
        "faults: one run is refused",
        "robots: known links, nothing is missing",
        "robots: a robot file that is not there is refused",
        "set-up: a reversed joint",
        "set-up: another zero",
    }
)
"""Rows of every theme that take a few seconds. `make test` runs their first seeds; all else is slow."""
