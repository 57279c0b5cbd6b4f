"""`CopEstimator`: one tick of the base estimator, a pure function of a state and a sample."""

from dataclasses import replace
from typing import Any

import numpy as np

from drake_tc.estimation.base.attitude import LARGEST_BIAS, attitude
from drake_tc.estimation.base.imu_filters import USUAL_TIME
from drake_tc.estimation.base.kinematics import Posture
from drake_tc.estimation.base.on_kinematics import OnKinematics
from drake_tc.estimation.base.pose_update import find_place
from drake_tc.estimation.base.sinking import shown_vertical
from drake_tc.estimation.base.spec import BaseEstimatorSpec
from drake_tc.estimation.base.state import BaseState, Readings
from drake_tc.estimation.base.status import status_flags
from drake_tc.estimation.base.valid_sample import ValidSample, valid_sample
from drake_tc.estimation.base.velocity_update import Setting, find_loads, find_motion, find_sinking
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray

_SETTLED = 0.1
"""What a contact does when it is made says nothing about the vertical [s]."""
_LARGEST = 1e12
"""Sum of squares of an estimate that is still one; NaN is not below it either."""


class CopEstimator(OnKinematics):
    """Base position, velocity and yaw from the point of each contact that stands still, the centre of pressure.

    Stage 1 (`velocity`), then stage 2 (`pose`), every tick; roll and pitch from the IMU, or from gyro and
    accelerometer. A contact that carries load holds its centre of pressure where it was: a reference that follows the
    centre of pressure as it moves over the sole, and slowly adapts where contacts disagree. What cannot be believed,
    or gives no numbers, gives way to what the last tick knew, and raises a flag (`state.FLAGS`).
    """

    def __init__(self, robot: Robot, spec: BaseEstimatorSpec) -> None:
        """As `OnKinematics`."""
        super().__init__(robot, spec)
        self._setting = Setting.of(spec)

    def step(self, scratch: Any, state: BaseState, readings: Readings) -> BaseState:
        """The state after one sample; never raises, never holds a NaN but an unknown ground.

        Args:
            scratch: From `create_scratch`.
            state: Before it.
            readings: The sample.
        """
        with np.errstate(over="ignore", invalid="ignore"):  # readings may be infinite
            sample = valid_sample(readings, state, self.spec)
        try:
            after = self._step(scratch, state, sample, readings.switch)
        except (np.linalg.LinAlgError, ArithmeticError, ValueError):
            return _kept(state)
        p, v, held = after.position, after.velocity, after.held
        size = p @ p + v @ v + np.vdot(held, held) + after.rotation[0] @ after.rotation[0]
        return after if size < _LARGEST else _kept(state)

    def _step(self, scratch: Any, state: BaseState, sample: ValidSample, switch: FloatArray) -> BaseState:
        still = self.kinematics.posture(scratch, sample.q, sample.qd)
        if not sample.has_gyro:
            sample = sample._replace(gyro=_gyro_of_foot(state, still))
        shown = None
        if self._setting.any_soft and self._setting.level:
            shown = shown_vertical(self._setting.soft, still, state)
        pose = attitude(still, state, sample, self.spec, shown)
        posture = still.turning(pose.rate)
        loads = find_loads(self._setting, self.kinematics, state, sample, posture, pose, switch)
        sunk = find_sinking(self._setting, state, posture, loads)
        if sunk is not None:
            posture = sunk.posture
        motion = find_motion(self._setting, state, sample, posture, pose, loads)
        place = find_place(self._setting, state, posture, pose, loads, motion, sunk)
        R_WC = place.rotation @ posture.rotation[:-1]
        foot, foot_up = R_WC, state.foot_up
        if loads.changed or self.spec.reference == "touchdown":
            held = np.array([touches and not new for touches, new in zip(loads.on, loads.new, strict=True)])
            foot_up = np.where(held[:, None], state.foot_up, loads.up)
            if self.spec.reference == "touchdown":
                foot = np.where(held[:, None, None], state.foot, R_WC)
        usual = motion.pressure
        if not loads.changed and state.started:
            usual = state.usual + min(1.0, self.spec.period / USUAL_TIME) * (usual - state.usual)
        bias = pose.bias
        if place.bias:
            bias = bias - place.bias * pose.up_imu
            if bias @ bias > LARGEST_BIAS**2:
                bias = pose.bias
        airborne = [
            0.0 if touches else row[3] + 1.0 for touches, row in zip(loads.on, state.contacts.tolist(), strict=True)
        ]
        told = status_flags(
            self._setting, state, sample, loads, motion, place.inconsistent, foot_up, airborne,
            bias_up=float(bias @ pose.up_imu), weight=self.kinematics.weight,
        )  # fmt: skip
        rigid = [0.0] * len(loads.on)
        depth, shape = (rigid, rigid) if sunk is None else (sunk.depth, sunk.shape)
        memory = zip(
            loads.on,
            loads.load,
            motion.slip.dropped,
            airborne,
            depth,
            shape,
            place.held_for,
            told.air_load,
            strict=True,
        )
        return BaseState(
            started=1.0,
            yaw=place.yaw,
            rested=pose.rested,
            quiet=pose.quiet,
            stood=_stood(state, motion.weight, place.held_for, self.spec.period),
            paired=place.paired,
            mismatch=told.mismatch,
            ground=place.ground,
            position=place.position,
            rotation=place.rotation,
            velocity=motion.velocity,
            rate=pose.rate,
            lever=posture.velocity[-1],
            bias=bias,
            trail=pose.trail,
            velocity_innovation=motion.velocity_innovation,
            usual=usual,
            held=place.held,
            foot=foot,
            foot_up=foot_up,
            pressure=motion.pressure,
            drift=motion.slip.drift,
            contacts=np.array(list(memory), dtype=float),
            q=sample.q,
            qd=sample.qd,
            doubt=sample.doubt,
            flags=told.flags,
            contact_flags=told.contact_flags,
        )


def _stood(state: BaseState, weight: FloatArray, held_for: list[float], period: float) -> float:
    """Ticks in which contacts told the velocity; 0 while none that counts has been held for `_SETTLED`."""
    least = _SETTLED / period
    told = any(w > 0.0 and held > least for w, held in zip(weight.tolist(), held_for, strict=True))
    return state.stood + 1.0 if told else 0.0


def _gyro_of_foot(state: BaseState, posture: Posture) -> FloatArray:
    """(3,) what the gyro would read if the most loaded foot did not turn; its bias if there is none."""
    touching = state.contacts[:, 0] > 0.0
    if not touching.any():
        return state.bias
    i = int(np.argmax(np.where(touching, state.contacts[:, 1], -np.inf)))
    gyro: FloatArray = state.bias + (posture.rate[-1] - posture.rate[i]) @ posture.rotation[-1]
    return gyro


def _kept(state: BaseState) -> BaseState:
    """The same once more, at rest, with the flag that says so."""
    flags = np.zeros_like(state.flags)
    flags[-1] = 1.0
    return replace(state, velocity=np.zeros(3), rate=np.zeros(3), lever=np.zeros(3), flags=flags)
