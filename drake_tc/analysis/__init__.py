"""Stability of sampled torque loops: linearisation, margins, one joint in closed form, limit cycles."""

from typing import TYPE_CHECKING

from drake_tc.front_door import front_door

if TYPE_CHECKING:
    from drake_tc.analysis.frequency_response import channel, swept_sine
    from drake_tc.analysis.limit_cycle import (
        coulomb_gain,
        deadzone_gain,
        find_limit_cycle,
        predicted_limit_cycles,
        saturation_gain,
    )
    from drake_tc.analysis.sampled import linearise, loop_margins, open_loop

__all__ = [
    "channel",
    "coulomb_gain",
    "deadzone_gain",
    "find_limit_cycle",
    "linearise",
    "loop_margins",
    "open_loop",
    "predicted_limit_cycles",
    "saturation_gain",
    "swept_sine",
]

_HOMES = {
    "channel": "frequency_response",
    "coulomb_gain": "limit_cycle",
    "deadzone_gain": "limit_cycle",
    "find_limit_cycle": "limit_cycle",
    "predicted_limit_cycles": "limit_cycle",
    "saturation_gain": "limit_cycle",
    "linearise": "sampled",
    "loop_margins": "sampled",
    "open_loop": "sampled",
    "swept_sine": "frequency_response",
}

__getattr__, __dir__ = front_door(__name__, _HOMES)
