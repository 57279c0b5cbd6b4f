"""What a joint's linear loop makes of a motion: its tracking error and the noise in its command, without simulating.

With e = q_d - q, G from the drive's effort to the position and C the feedback law of `JointLoop` (y = C q), the effort
that the law gives along the reference itself falls short of what the drive needs there by a mismatch m(t), and

    e = G/(1 - G C) m,       m = y_needed - y_law(q = q_d)

    y_law = K_tau' [(1 + Kp) tau_r - Kp tau_e + (1 + Kp) Kd (q_d' - vhat) + Ki h sum(tau_r - tau_e + Kd (q_d' - vhat))]
            + K_v' vhat + y_extra
    tau_e = I ahat + z^-(1+d) w_0 (tau_r - I q_d'')       vhat, ahat: the filter's, of q_d

Along the reference all that is not linear (dead zone, dry friction, a gain that switches) is a function of time. So the
delay of a long window is in m, what the feedback makes of it in G/(1 - G C); an encoder's noise enters as (C + 1) n,
that of the estimated torque as -K_tau' (Kp + Ki h/(z - 1)) w_0 n.

That is right as long as the joint slides with the reference. Where it starts, stops or turns round, dry friction holds
it (`sticking_error`): of the drive's effort, friction takes what brings the joint to rest within a tick, y_c at most.
There the run also begins as the guard begins it, with the share w of the law in a servo's command, and so with the
effort w y + (1 - w) (q[0] - q): a joint that carries a weight sags, and friction may hold it where it has sagged.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import lfilter

from drake_tc.control.joint_loop import JointLoop
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

SETTLING = 1500
"""Ticks over which the loop's answer to one sample of noise is summed up."""


@dataclass(frozen=True, eq=False)
class JointTask:
    """A joint, the motion it is asked for, and the setting it has now.

    Attributes:
        joint: Name.
        loops: The joint with its present gains where its inertia is typical for the motion, then at other postures,
            where the margins must hold as well.
        position, velocity, acceleration: (T,) q_d, q_d', q_d'' [rad, rad/s, rad/s^2].
        torque: (T,) tau_r, of the link along the reference [N m].
        needed: (T,) y_needed, what the drive with all its effects needs along the reference [effort].
        extra: (T,) y_extra, what the controller compensates beyond K_tau' tau + K_v' qdot [effort].
        dry: (T,) y_c, the share of `needed` that dry friction takes in sliding; in `needed` with the sign of q_d'
            [effort].
        share: (T,) w, of the law in the command.
        encoder_noise: [rad] a sample.
        torque_noise: Of the estimated torque a sample, before the filter [N m].
        begin: Errors are evaluated from this row on.

    Raises:
        ParamsError: rows that do not agree, or no loop.
    """

    joint: str
    loops: tuple[JointLoop, ...]
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    torque: FloatArray
    needed: FloatArray
    extra: FloatArray
    dry: FloatArray
    share: FloatArray
    encoder_noise: float = 0.0
    torque_noise: float = 0.0
    begin: int = 0

    def __post_init__(self) -> None:
        if not self.loops:
            raise ParamsError(f"task of {self.joint}: expected at least one loop")
        samples = self.position.shape
        for name in ("velocity", "acceleration", "torque", "needed", "extra", "dry", "share"):
            if getattr(self, name).shape != samples or len(samples) != 1:
                raise ParamsError(
                    f"task of {self.joint}: expected {name} of shape {samples}, got {getattr(self, name).shape}"
                )
        if not 0 <= self.begin < max(samples[0], 1):
            raise ParamsError(f"task of {self.joint}: expected 0 <= begin < {samples[0]}, got {self.begin}")


@dataclass(frozen=True, eq=False)
class FilteredTask:
    """A task behind one filter: what every choice of gains has in common.

    Attributes:
        task: The task.
        late_velocity: (T,) q_d' - vhat [rad/s].
        late_torque: (T,) tau_r - tau_e [N m].
    """

    task: JointTask
    late_velocity: FloatArray = field(repr=False)
    late_torque: FloatArray = field(repr=False)


def filtered_task(task: JointTask, window: int, order: int, at: float | None = None) -> FilteredTask:
    """The task behind a filter.

    Raises:
        ParamsError: as `savgol_weights`.
    """
    loop = replace(task.loops[0], window=window, order=order, at=at)
    velocity, acceleration = (_estimate(loop, task.position, k) for k in (1, 2))
    rest = _estimate(loop, task.torque - loop.link_inertia * task.acceleration, 0)
    seen = loop.link_inertia * acceleration + rest
    return FilteredTask(task, task.velocity - velocity, task.torque - seen)


def predicted_error(filtered: FilteredTask, loop: JointLoop) -> FloatArray:
    """(T,) tracking error [rad] of a loop with the task's filter, from rest.

    Args:
        filtered: Task behind the loop's filter.
        loop: Its plant, model and filter with any gains.
    """
    return np.asarray(_through(loop, _mismatch(filtered, loop)))


def _mismatch(filtered: FilteredTask, loop: JointLoop) -> FloatArray:
    """(T,) effort that the law falls short of along the reference."""
    task = filtered.task
    k_tau, late = loop.k_tau_model, filtered.late_velocity
    law = task.torque + loop.kp * filtered.late_torque + (1.0 + loop.kp) * loop.kd * late
    if loop.ki:
        summed = np.cumsum(filtered.late_torque + loop.kd * late)
        law = law + loop.ki * loop.dt * np.append(0.0, summed[:-1])
    seen = task.velocity - late if loop.velocity_from == "estimate" else task.velocity
    return np.asarray(task.needed - task.extra - k_tau * law - loop.k_v_model * seen)


def sticking_error(filtered: FilteredTask, loop: JointLoop) -> FloatArray:
    """(T,) tracking error [rad] of a stable loop with the task's filter, from rest, where dry friction can hold it.

    Args:
        filtered: Task behind the loop's filter.
        loop: Its plant, model and filter with any gains.
    """
    task, g, law = filtered.task, loop.drive_gain, loop.feedback[::-1].copy()
    asked, most = task.needed - _mismatch(filtered, loop), g * np.abs(task.dry)
    smooth = task.needed - task.dry * np.sign(task.velocity)
    away = task.position - task.position[0]
    step = np.diff(task.position, append=task.position[-1])
    before, summed = law.size, 0.0
    error = np.zeros(before + step.size)
    _, last, first = loop.plant
    for n, at in enumerate(range(before, error.size - 1)):
        answer = float(law @ error[n + 1 : at + 1])
        summed = summed + answer if loop.ki else answer
        effort = task.share[n] * (asked[n] - summed) + (1.0 - task.share[n]) * (error[at] - away[n])
        free = g * (smooth[n] - effort) - last * error[at] - first * error[at - 1]
        error[at + 1] = free + min(max(error[at] + step[n] - free, -most[n]), most[n])
    return error[before:]


def predicted_noise(task: JointTask, loop: JointLoop) -> tuple[float, float]:
    """RMS (of the tracking error [rad], of the drive's effort [effort]) that the sensors' noise makes.

    White noise of the encoder and, independent of it, of the estimated torque; the effort is what the command asks of
    the servo, q_command - q.
    """
    error, effort = 0.0, 0.0
    for size, law in ((task.encoder_noise, _encoder_law(loop)), (task.torque_noise, _torque_law(loop))):
        pulse = np.append(1.0, np.zeros(SETTLING))
        entering = lfilter(law, loop.integrator, pulse)
        moved = _through(loop, entering)
        answer = entering + lfilter(loop.feedback, loop.integrator, moved)
        error += size**2 * float(moved @ moved)
        effort += size**2 * float(answer @ answer)
    return float(np.sqrt(error)), float(np.sqrt(effort))


def _through(loop: JointLoop, effort: FloatArray) -> FloatArray:
    """G/(1 - G C) of an effort."""
    return np.asarray(lfilter(loop.drive_gain * np.append(0.0, loop.integrator), loop.characteristic(), effort))


def _estimate(loop: JointLoop, signal: FloatArray, derivative: int) -> FloatArray:
    """What a reader sees at each tick, from rest at the first sample."""
    weights = loop.late_weights(loop.order, derivative)
    start = float(signal[0])
    seen = lfilter(weights, [1.0], signal - start)
    return np.asarray(seen + start if derivative == 0 else seen)


def _encoder_law(loop: JointLoop) -> FloatArray:
    """C + 1, over 1 - 1/z where there is an integral: the command is the reading plus y."""
    law = loop.feedback.copy()
    law[: loop.integrator.size] += loop.integrator
    return law


def _torque_law(loop: JointLoop) -> FloatArray:
    """-K_tau' (Kp + Ki h/(z - 1)) w_0, over 1 - 1/z where there is an integral."""
    weights = loop.late_weights(loop.inertial_order, 0)
    feedback = np.array([loop.kp, loop.ki * loop.dt - loop.kp]) if loop.ki else np.array([loop.kp])
    return np.asarray(-loop.k_tau_model * np.convolve(feedback, weights))
