"""A setting of window and gains, what it comes to for a joint, and what is asked of it.

Margins of a `JointLoop` at a fraction of a millisecond, on a grid of frequencies: for searches over many gains.

With A the plant's polynomial (and the integrator's) in 1/z and X the characteristic one, 1 + L = X/A at the drive's
effort, so two Fourier transforms of coefficients give L on a uniform grid up to the Nyquist frequency. X has no root
outside the unit circle when its phase comes back to where it was from z = 1 to z = -1 (argument principle).
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from drake_tc.analysis.tracking_error import FilteredTask, JointTask, filtered_task, predicted_error, predicted_noise
from drake_tc.control.joint_loop import JointLoop, quick_margins, value_of, with_values
from drake_tc.control.stability_margins import Margins
from drake_tc.errors import ParamsError

SLACK = 1e-3
"""Relative: a margin this little below its goal meets it (the grid's resolution)."""


@dataclass(frozen=True)
class Setting:
    """What is tuned: window [samples] and order of the encoder's filter, Kp [-], Ki [1/s], K7 [s]."""

    window: int
    order: int
    kp: float
    ki: float
    k7: float


@dataclass(frozen=True)
class Assessed:
    """A setting and what it comes to, margins and noise at the worst of the task's postures.

    Attributes:
        setting: The setting.
        error: Predicted RMS tracking error, noise included [rad].
        noise: RMS of the noise in the command, as torque of the drive [N m].
        sensitivity_peak: [-].
        delay_margin: [s].
        gain_margin: [-], the nearest to 1.
    """

    setting: Setting
    error: float
    noise: float
    sensitivity_peak: float
    delay_margin: float
    gain_margin: float


@dataclass(frozen=True)
class Goal:
    """What a setting must keep.

    Attributes:
        sensitivity_peak: At most this, > 1 [-].
        delay_margin: At least this [s].
        noise: RMS of the noise in the command at most this [N m].

    Raises:
        ParamsError: a number that is not possible.
    """

    sensitivity_peak: float = np.inf
    delay_margin: float = 0.0
    noise: float = np.inf

    def __post_init__(self) -> None:
        if not (self.sensitivity_peak > 1.0 and self.delay_margin >= 0.0 and self.noise >= 0.0):
            raise ParamsError(
                f"goal: expected a sensitivity peak > 1, a delay margin >= 0 s and a noise >= 0 N m, got {self}"
            )

    def met(self, assessed: Assessed) -> bool:
        """Whether a setting keeps it."""
        return (
            assessed.sensitivity_peak <= self.sensitivity_peak * (1.0 + SLACK)
            and assessed.delay_margin >= self.delay_margin * (1.0 - SLACK)
            and assessed.noise <= self.noise
        )


@dataclass(frozen=True, eq=False)
class Batch:
    """Gains of one joint behind one filter: a point of a sweep."""

    task: JointTask
    window: int
    order: int
    gains: tuple[tuple[float, float, float], ...]


def with_setting(loop: JointLoop, setting: Setting) -> JointLoop:
    """The loop with another setting, as stiff as it was (K6)."""
    return with_values(loop, asdict(setting))


def setting_of(loop: JointLoop) -> Setting:
    """The setting that a loop has."""
    return Setting(loop.window, loop.order, loop.kp, loop.ki, value_of(loop, "k7"))


def assess(task: JointTask, setting: Setting) -> Assessed | None:
    """What a setting comes to, with exact margins; None where it is unstable at one of the postures."""
    loops = [with_setting(loop, setting) for loop in task.loops]
    if max(loop.spectral_radius() for loop in loops) >= 1.0:
        return None
    filtered = filtered_task(task, setting.window, setting.order, loops[0].at)
    return _assessed(filtered, setting, loops, [loop.margins() for loop in loops])


def _assessed(
    filtered: FilteredTask, setting: Setting, loops: Sequence[JointLoop], found: Sequence[Margins]
) -> Assessed:
    error = predicted_error(filtered, loops[0])[filtered.task.begin :]
    shaking, effort = predicted_noise(filtered.task, loops[0])
    return Assessed(
        setting,
        float(np.sqrt(np.mean(error**2) + shaking**2)),
        effort / loops[0].k_tau,
        max(each.sensitivity_peak for each in found),
        min(each.delay_margin for each in found),
        min((each.gain_margin for each in found), key=lambda gain: abs(np.log(gain))),
    )


def present(task: JointTask) -> Assessed | None:
    """What the task's own setting comes to; None where it is unstable."""
    return assess(task, setting_of(task.loops[0]))


def assess_batch(batch: Batch, seed: int) -> list[Assessed]:
    """The stable settings of a batch, margins on a grid; the seed is not used."""
    task, out = batch.task, []
    filtered = filtered_task(task, batch.window, batch.order, task.loops[0].at)
    for kp, ki, k7 in batch.gains:
        setting = Setting(batch.window, batch.order, kp, ki, k7)
        loops = [with_setting(loop, setting) for loop in task.loops]
        found = [quick_margins(loop) for loop in loops]
        sound = [each for each in found if each is not None]
        if len(sound) == len(found):
            out.append(_assessed(filtered, setting, loops, sound))
    return out


def default_goals(
    tasks: Sequence[JointTask], peak: float | None = None, delay: float | None = None, noise: float = 1.0
) -> list[Goal]:
    """One goal a joint.

    Args:
        tasks: One a joint.
        peak: Sensitivity peak for all; None: that of the joint's own present setting, or better.
        delay: Delay margin for all [s]; None: as `peak`.
        noise: As a multiple of what the vendor's servo makes of the encoder's noise, sigma/K_tau; the present setting's
            own, where that is more.

    Raises:
        ParamsError: a present setting that is unstable and so has no margins to keep.
    """
    goals = []
    for task in tasks:
        now = present(task)
        if now is None and (peak is None or delay is None):
            raise ParamsError(
                f"tune: the present setting of {task.joint} is unstable; give margins in numbers (--margin,"
                " --delay-margin)"
            )
        own = Goal() if now is None else Goal(now.sensitivity_peak, now.delay_margin)
        floor = 0.0 if now is None else now.noise
        servo = noise * task.encoder_noise / task.loops[0].k_tau
        goals.append(
            Goal(
                own.sensitivity_peak if peak is None else peak,
                own.delay_margin if delay is None else delay,
                max(servo, floor) if task.encoder_noise else np.inf,
            )
        )
    return goals
