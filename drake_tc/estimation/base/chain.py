"""The baselines: the chain from a foot whose centre is taken to stand still, without the IMU and with it."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from drake_tc.estimation.base.attitude import attitude
from drake_tc.estimation.base.imu_filters import GRAVITY, up_of
from drake_tc.estimation.base.kinematics import Posture
from drake_tc.estimation.base.on_kinematics import OnKinematics
from drake_tc.estimation.base.pose import levelled, turned
from drake_tc.estimation.base.state import BaseState, Readings
from drake_tc.estimation.base.valid_sample import ValidSample, valid_sample
from drake_tc.types import FloatArray


class FootCentreEstimator(OnKinematics):
    """Leg odometry: the most loaded contact is fixed in the world, position and orientation, until another takes over.

    With F the fixed contact:   X_WB = X_WF X_BF^-1,   V_WB from no velocity of F.   Orientation comes from the chain;
    where the robot starts, from the IMU's roll and pitch if there are any. Of the tuning, only what concerns sensors'
    faults counts.
    """

    def step(self, scratch: Any, state: BaseState, readings: Readings) -> BaseState:
        """The state after one sample.

        Args:
            scratch: From `create_scratch`.
            state: Before it.
            readings: The sample.
        """
        with np.errstate(over="ignore", invalid="ignore"):  # readings may be infinite
            sample = valid_sample(readings, state, self.spec)
        posture = self.kinematics.posture(scratch, sample.q, sample.qd)
        R, p = posture.rotation[:-1], posture.position[:-1]
        if not state.started:
            R_WB = turned(state.yaw) @ levelled(_first_up(sample.tilt, sample.accel, posture.rotation[-1]))
            state = replace(state, rotation=R_WB)
        up_C = np.matmul(state.rotation[2], R)
        load = self.kinematics.external_wrench(sample.wrench, -GRAVITY * up_C)[:, 2]
        load = np.where(readings.switch < 0.0, -np.inf, load)
        i = int(np.argmax(load))
        if not state.contacts[i, 0] or not state.started:
            contacts = np.zeros_like(state.contacts)
            contacts[i, 0] = 1.0
            here = state.rotation
            last = self.kinematics.posture(scratch, state.q, state.qd) if state.started else posture
            foot, held = here @ last.rotation[:-1], state.position + last.position[:-1] @ here.T
            state = replace(state, contacts=contacts, foot=foot, held=held)
        rotation, rate, kept = self._turned(state, sample, posture, i)
        velocity = -(posture.velocity[i] + np.cross(rate, p[i]))
        flags = np.zeros_like(state.flags)
        return replace(
            state,
            started=1.0,
            position=state.held[i] - rotation @ p[i],
            yaw=math.atan2(rotation[1, 0], rotation[0, 0]),
            rotation=rotation,
            velocity=velocity,
            rate=rate,
            q=sample.q,
            qd=sample.qd,
            doubt=sample.doubt,
            flags=flags,
            **kept,
        )

    def _turned(
        self, state: BaseState, sample: ValidSample, posture: Posture, foot: int
    ) -> tuple[FloatArray, FloatArray, dict[str, Any]]:
        """R_WB (3, 3), omega_b (3,) [rad/s], and what else is remembered, with a foot that does not turn."""
        return state.foot[foot] @ posture.rotation[foot].T, -posture.rate[foot], {}


class FootCentreImuEstimator(FootCentreEstimator):
    """The same with roll, pitch and angular velocity by the IMU, as `attitude` has them; yaw by the chain.

    The foot's centre is still taken to stand still, whichever way the foot tilts. Without a gyro it is the chain alone.
    """

    def _turned(
        self, state: BaseState, sample: ValidSample, posture: Posture, foot: int
    ) -> tuple[FloatArray, FloatArray, dict[str, Any]]:
        chain, rate, kept = super()._turned(state, sample, posture, foot)
        if not sample.has_gyro:
            return chain, rate, kept
        pose = attitude(posture, state, sample, self.spec)
        rotation: FloatArray = turned(math.atan2(chain[1, 0], chain[0, 0])) @ pose.level
        kept = {name: getattr(pose, name) for name in ("bias", "trail", "rested", "quiet")}
        return rotation, pose.rate, kept


def _first_up(tilt: FloatArray, accel: FloatArray, R_BI: FloatArray) -> FloatArray:
    up = up_of(*tilt.tolist()) if np.isfinite(tilt).all() else accel / max(float(np.linalg.norm(accel)), 1e-9)
    out: FloatArray = R_BI @ up
    return out
