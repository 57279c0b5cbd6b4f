"""`FootCentreEstimator`: the baseline, the chain from a foot whose centre is taken to stand still."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from drake_tc.estimation.base.believed import believed
from drake_tc.estimation.base.on_kinematics import OnKinematics
from drake_tc.estimation.base.pose import levelled, turned
from drake_tc.estimation.base.state import BaseState, Readings
from drake_tc.estimation.base.tilt import GRAVITY, up_of
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
            sample = believed(readings, state, self.spec)
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
        rotation = state.foot[i] @ R[i].T
        rate = -posture.rate[i]
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
        )


def _first_up(tilt: FloatArray, accel: FloatArray, R_BI: FloatArray) -> FloatArray:
    up = up_of(*tilt.tolist()) if np.isfinite(tilt).all() else accel / max(float(np.linalg.norm(accel)), 1e-9)
    out: FloatArray = R_BI @ up
    return out
