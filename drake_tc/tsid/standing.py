"""Where a floating base is and how it moves, as the contacts that carry it and an IMU tell: legs as odometers.

In the base's axes, the corners of the contacts are at b_i(q_j) and move with bdot_i. Those that carry stay at their
places a_i in the world, on the mean: soles and floors that give way rock about it. With I the IMU's frame,

    omega = R_BI gyro - J_omega,j qdot                        of the base, in its axes
    R     = (R_last exp(omega h)) turned by h/T towards R_k,  R_k, p_k = argmin sum_i |a_i - R b_i - p|^2
    p     = mean(a_i - R b_i),   v = -R mean(omega x b_i + bdot_i)

Fewer than three corners do not tell R_k; the gyro alone turns the base then.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from drake_tc.array_stage import Arrays, ArrayStage, StageSystem, places
from drake_tc.control.rotation import quaternion_of, rotation_matrix, rotation_vector
from drake_tc.errors import ParamsError
from drake_tc.tsid.fused import LARGEST
from drake_tc.tsid.model import Scratch, TsidModel
from drake_tc.types import BoolArray, Call, FloatArray

ENOUGH = 3
"""Corners that tell an attitude."""


def fit_rotation(inside: FloatArray, outside: FloatArray) -> FloatArray:
    """R (3, 3) of outside_i = R inside_i + p by least squares, for (m, 3) points that are not on one line.

    Source: Kabsch, Acta Crystallographica A 1976.
    """
    left, _, right = np.linalg.svd((outside - outside.mean(axis=0)).T @ (inside - inside.mean(axis=0)))
    left[:, 2] *= np.sign(np.linalg.det(left) * np.linalg.det(right))
    rotation: FloatArray = left @ right
    return rotation


def turned(vector: FloatArray) -> FloatArray:
    """R of a rotation vector (3,) [rad]."""
    half = 0.5 * float(np.linalg.norm(vector))
    return rotation_matrix(np.concatenate(([np.cos(half)], 0.5 * np.sinc(half / np.pi) * vector)))


class StandingState(StageSystem):
    """The state of a robot with a floating base from its joints, its first IMU and the contacts that carry it.

    Inputs:
        position, velocity (n): in the robot's order [rad, rad/s].
        imu (6): [gyro; accel] in the IMU's frame [rad/s, m/s^2]; the gyro counts.
        active_contacts (contacts): above 1/2 where one carries; all of them when not connected.
    Output:
        estimated_state (nq + nv): [q; v] in the order of the model; NaN where an input is not finite, or as large as
            `fused.LARGEST`.

        y[n] = F(u[n], x[n]),  x[n+1] = [corners a (3 c); quaternion of R]

    where corners that do not carry move with the robot, so that a contact stands where it was put down. Where the
    output is NaN, x stays as it is.
    """

    graph_stage = "estimation"

    def __init__(self, model: TsidModel, period: float, trust: float = 0.5) -> None:
        """Declare the ports; the robot starts in its robot file's posture, every contact where that puts it.

        Args:
            model: Of the robot and its contacts.
            period: h, of the updates [s].
            trust: T, how long the gyro is trusted alone [s].

        Raises:
            ParamsError: a base that is fixed, no contact, no IMU, or a time that is not positive.
        """
        super().__init__()
        robot = model.robot
        for lacks, what in ((robot.fixed_base, "a floating base"), (not model.contacts, "contacts")):
            if lacks:
                raise ParamsError(f"state of {robot.name!r}: expected {what}; it has none")
        if not robot.imu:
            raise ParamsError(f"state of {robot.name!r}: expected an IMU in {robot.source}; it has none")
        if not (np.isfinite([period, trust]).all() and 0.0 < period <= trust):
            raise ParamsError(f"state: expected 0 < period <= trust [s], got {period!r} and {trust!r}")
        self._model, self._period, self._trust, self._imu_mount = model, period, trust, robot.imu[0]
        self._turn = np.array(robot.imu[0].pose.transform.rotation().matrix())
        self._base_q = np.setdiff1d(np.arange(model.nq), model.positions)
        self._base_v = np.setdiff1d(np.arange(model.nv), model.actuated)
        self._owner = np.concatenate([np.full(len(c.corners), i) for i, c in enumerate(model.contacts)])
        start = model.start[self._base_q]
        body = _Body(self, model.create_scratch(), model.start[model.positions], np.zeros(model.n))
        first: Any = np.concatenate([(body.corners @ rotation_matrix(start[:4]).T + start[4:]).ravel(), start[:4]])
        self._first: FloatArray = first
        self._declare({"position": model.n, "velocity": model.n, "imu": 6, "active_contacts": len(model.contacts)})

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        model, names = self._model, ("position", "velocity", "imu")
        size = model.nq + model.nv

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            known, held, out, after = _Known(model.create_scratch()), arrays.before, arrays.out, arrays.after
            now, switch = [arrays.inputs[name] for name in names], arrays.inputs.get("active_contacts")

            def outputs(time: float) -> None:
                self._know(known, held, now, switch)
                out[:] = known.state

            def update(time: float) -> None:
                if known.memory is not None:
                    after[:] = known.memory

            return outputs, update

        reads, ports = frozenset({*names, "active_contacts"}), places({"estimated_state": slice(size)})
        return ArrayStage(size, ports, bind, reads, start=self._first, period=self._period)

    def _know(self, known: "_Known", held: FloatArray, now: Sequence[FloatArray], switch: FloatArray | None) -> None:
        """The state of a tick and the memory after it, from inputs `now` and the memory `held` before it."""
        model = self._model
        switch = np.ones(len(model.contacts)) if switch is None else switch
        position, velocity, imu = now
        known.state, known.memory = np.full(model.nq + model.nv, np.nan), None
        if not np.abs(np.concatenate((position, velocity, imu[:3], switch))).max() < LARGEST:
            return
        body = _Body(self, known.scratch, position, velocity)
        omega = body.imu_rotation @ (self._turn @ imu[:3]) - body.imu_rate
        carries: BoolArray = (switch > 0.5)[self._owner]
        stood, last = held[:-4].reshape(-1, 3), rotation_matrix(held[-4:])
        rotation = last @ turned(self._period * omega)
        if carries.sum() >= ENOUGH:
            lean = rotation_vector(fit_rotation(body.corners[carries], stood[carries]) @ rotation.T)
            rotation = turned(self._period / self._trust * lean) @ rotation
        some = carries if carries.any() else np.ones_like(carries)
        place = (stood[some] - body.corners[some] @ rotation.T).mean(axis=0)
        mean, rate = body.corners[some].mean(axis=0), body.rates[some].mean(axis=0)
        quaternion, state = quaternion_of(rotation), np.empty(model.nq + model.nv)
        state[self._base_q] = np.concatenate((quaternion, place))
        state[model.positions] = position
        state[model.nq + self._base_v] = np.concatenate((rotation @ omega, -rotation @ (np.cross(omega, mean) + rate)))
        state[model.nq + model.actuated] = velocity
        moved = np.where(carries[:, None], stood, body.corners @ rotation.T + place)
        memory = np.concatenate((moved.ravel(), quaternion))
        if np.isfinite(np.concatenate((state, memory))).all():
            known.state, known.memory = state, memory

    @property
    def parts(self) -> tuple[TsidModel, Any, str]:
        """The model, where the base stands in its q, and the IMU's link."""
        return self._model, self._base_q, self._imu_mount.link


class _Body:
    """The robot with its base held at the origin: corners (m, 3), their rates, the IMU's link's R and omega."""

    def __init__(self, system: StandingState, scratch: Scratch, position: FloatArray, velocity: FloatArray) -> None:
        model, base, link = system.parts
        q, v = np.zeros(model.nq), np.zeros(model.nv)
        q[base[0]], q[model.positions], v[model.actuated] = 1.0, position, velocity
        terms = model.terms(scratch, q, v)
        corners, rates = [], []
        for contact, rows in zip(model.contacts, terms.contacts.rows, strict=True):
            rotation, place = terms.pose(contact.name)
            twist = terms.contact_velocity[rows]
            spin = twist[3:] if contact.size == 6 else np.zeros(3)
            corners.append(place + contact.corners @ rotation.T)
            rate = twist[:3] + np.cross(spin, contact.corners)
            rates.append(rate if contact.upright else rate @ rotation.T)
        imu = terms.frame(link)
        self.corners, self.rates = np.concatenate(corners), np.concatenate(rates)
        self.imu_rotation, self.imu_rate = imu.rotation, imu.velocity[:3]


class _Known:
    """What the cache entry holds."""

    def __init__(self, scratch: Scratch) -> None:
        self.scratch = scratch
        self.state: FloatArray = np.zeros(0)
        self.memory: FloatArray | None = None
