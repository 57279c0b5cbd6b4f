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
