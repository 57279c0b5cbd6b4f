"""`StandingFeet`: what feet that stand say of the base, to check a gyro by and to go on without an IMU."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from drake_tc.array_stage import Arrays, ArrayStage, StageSystem, places
from drake_tc.kernels.calls import Kernel
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot
from drake_tc.tsid.contacts import Contact
from drake_tc.types import Call, FloatArray

TILT_TIME = 0.05
"""In which a tilt that no IMU measures goes over to that of the soles [s]."""
_EVERY = 5
"""Ticks from one look at the gyro to the next."""
_AVERAGED, _RATED = 0.03, 0.02
"""Over which feet seem to turn, and over which their tilts change [s]."""
TURNING = 0.011
"""Yaw rate that feet do not have [rad/s]: less than 1 deg/s; noise and the gyro's bias make up to 0.006 of it."""
RESTS, _REMEMBERED = 0.05, 0.3
"""Root mean square of joint speeds below which a robot rests [rad/s]: feet of one that turns at 1 Hz turn at up to
0.3 rad/s themselves; and how long a larger one is remembered [s]."""
LOST = 0.03
"""An IMU that has been left out for so long is lost [s]."""
_FLAG, _SPEED, _TILTS = 0, 2, 3
"""As `drake_tc.kernels.standing_feet` has them."""
_SHOWN, _SUNK, _ADVANCE = (Kernel("standing_feet", name) for name in ("shown", "sunk", "advance"))

Inputs = dict[str, Any]
"""Value of an input port by its name; None where it is not connected."""
_NO_TILT: FloatArray = np.full(2, np.nan)
_READ = ("estimated_state", "imu", "cop", "wrench")


def _finite(reading: FloatArray) -> bool:
    """Whether all of it is."""
    return bool(np.count_nonzero(np.isfinite(reading)) == reading.size)


class StandingFeet(StageSystem):
    """Soles on a level floor against the base estimate: as their springs let them tilt, and not turning.

    Inputs:
        estimated_state (nq + nv): [q; v] of the base estimator, a tick old.
        imu (6): [gyro; accel]; NaN where the IMU is left out.
        cop (2c): centres of pressure of the contacts [m], of the base estimator.
        wrench (6k): F/T readings [N, N m].
        link_angle (n): encoders behind the springs [rad], less noisy than the state's velocities.
        contacts (c): 0 where the controller does without a contact; all carry, when not connected.
    Outputs:
        reading (6): the input `imu`; where that is left out, the gyro is omega of below, the accelerometer NaN.
        imu_tilt (2): roll and pitch of the IMU [rad], for the estimator; NaN while it has an IMU. A sole under a force
            F at (x, y) tilts towards it, so the vertical in its axes is (-a_x F x, -a_y F y, 1), with its compliances a
            [rad/(N m)] (`SoleSpec`), and it turns at (-a_y (F y)', a_x (F x)', 0). With n the mean of those verticals
            in the estimate's world, u the vertical in the IMU's axes, omega its rate against the feet and theirs:
                u+ = u - dt omega x u + (dt/T) (R' n - u),   T = `TILT_TIME`
        lost (1): of the state. 1 where the IMU has been left out for `LOST`.
        flag (1): of the state. 1 where |s| > `TURNING` and the robot rests.
    State, every fifth tick: the flag; how long the IMU has been left out [s]; the joints' speed, which falls by a low
    pass alone; tilts of the soles through a low pass of 20 ms, whose difference to those of now, over that time, is
    their rate; the base's angular velocity and the link angles through one of 30 ms. With those and the link angles'
    rates, likewise, s is the mean yaw rate of the soles.
    A gyro that is off by b has feet turn at b that stand.
    """

    def __init__(
        self, robot: Robot, contacts: Sequence[Contact], sensor_of: Sequence[int], compliance: FloatArray, dt: float
    ) -> None:
        """Declare ports, state and the periodic update.

        Args:
            robot: With an IMU and F/T sensors.
            contacts: Of the controller; points are left out.
            sensor_of: Of each contact, which F/T sensor has its load.
            compliance: (c, 2) a_x, a_y of each [rad/(N m)]; 0 for a hard sole.
            dt: Period [s].
        """
        super().__init__()
        plant: Any = make_plant(robot, 0.0)
        self._places = [plant.GetJointByName(joint).velocity_start() for joint in robot.joints]
        self._plant, self._dt, self._n = plant, dt, len(robot.joints)
        memory, blend, sinking = (
            np.exp(-_EVERY * dt / _REMEMBERED),
            *(-np.expm1(-_EVERY * dt / time) for time in (_AVERAGED, _RATED)),
        )
        self._options = np.array([_EVERY * dt, memory, sinking, blend, plant.num_positions()])
        self._lost_after, self._no_imu = LOST - 0.5 * dt, np.full(6, np.nan)
        soles = [(number, contact) for number, contact in enumerate(contacts) if contact.kind == "surface"]
        self._which = np.array([number for number, _ in soles], dtype=int)
        self._links = [plant.GetBodyByName(contact.frame.link) for _, contact in soles]
        self._axes = [contact.frame.pose.transform.rotation().matrix() for _, contact in soles]
        sensors = np.array(sensor_of, dtype=int)[self._which]
        self._soles = sensors, self._which, np.asarray(compliance, dtype=float)[self._which]
        mount = robot.imu[0]
        self._imu_link, self._R_LI = plant.GetBodyByName(mount.link), mount.pose.transform.rotation().matrix()
        sizes = {
            "estimated_state": plant.num_multibody_states(),
            "imu": 6,
            "cop": 2 * len(contacts),
            "wrench": 6 * len(robot.force_torque),
            "contacts": len(contacts),
            "link_angle": self._n,
        }
        self._turns = slice(_TILTS + 2 * len(soles), _TILTS + 2 * len(soles) + 3)
        self._size = self._turns.stop + self._n + 1
        self._declare(sizes)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        ports = places({"reading": slice(6), "imu_tilt": slice(6, 8)})

        def bind_early(arrays: Arrays) -> tuple[Call, None]:
            before, out, shown = arrays.before, arrays.out, np.empty(10)

            def outputs(time: float) -> None:
                _SHOWN(self._no_imu, before, self._lost_after, shown)
                out[:] = shown[8:]

            return outputs, None

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            given: Inputs = {name: arrays.inputs[name] for name in (*_READ, "link_angle")}
            given["contacts"] = arrays.inputs.get("contacts")
            before, after, scratch = arrays.before, arrays.after, self._plant.CreateDefaultContext()
            imu, out, shown = given["imu"], arrays.out, np.empty(10)

            def outputs(time: float) -> None:
                if not _SHOWN(imu, before, self._lost_after, shown):
                    shown[:6] = self._reading(given, before, scratch)
                    shown[6:8] = self._imu_tilt(given, before, scratch)
                out[:] = shown[:8]

            def update(time: float) -> None:
                after[:] = self._next(given, before, scratch)

            return outputs, update

        updates, start, period = frozenset({"link_angle"}), np.zeros(self._size), _EVERY * self._dt
        early = ArrayStage(2, places({"flag": slice(1), "lost": slice(1, 2)}), bind_early)
        return ArrayStage(8, ports, bind, frozenset({*_READ, "contacts"}), updates, start, period, early)

    def _standing(self, given: Inputs) -> list[int]:
        """Soles that carry."""
        contacts = given["contacts"]
        if contacts is None:
            return list(range(len(self._links)))
        return np.flatnonzero(contacts[self._which] > 0.5).tolist()

    def _rates(self, scratch: Any, soles: list[int]) -> FloatArray:
        """(3,) mean angular velocity of the soles."""
        found = [self._plant.EvalBodySpatialVelocityInWorld(scratch, self._links[i]).rotational() for i in soles]
        return np.asarray(np.mean(found, axis=0))

    def _sunk(self, given: Inputs) -> FloatArray:
        """(soles, 2) tilts of the soles towards their centres of pressure [rad]."""
        tilts: FloatArray = np.empty((len(self._links), 2))
        _SUNK(given["wrench"], given["cop"], self._soles, tilts.ravel())
        return tilts

    def _moved(self, given: Inputs, scratch: Any) -> None:
        """Put a context of the plant at the estimate."""
        self._plant.SetPositionsAndVelocities(scratch, given["estimated_state"])

    def _seen(self, given: Inputs, held: FloatArray, scratch: Any) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """(3,) normal of the floor and (3,) rate of the IMU's link in the estimate's world, (3, 3) R_WI; or no sole."""
        soles = self._standing(given)
        if not soles:
            return None
        self._moved(given, scratch)
        plant, sunk = self._plant, self._sunk(given)
        rates = (sunk - held[_TILTS : self._turns.start].reshape(-1, 2)) / _RATED
        ups, turns = [], []
        for i in soles:
            axes = plant.EvalBodyPoseInWorld(scratch, self._links[i]).rotation().matrix() @ self._axes[i]
            ups.append(axes @ [*(-sunk[i]), 1.0] / np.sqrt(1.0 + sunk[i] @ sunk[i]))
            turns.append(axes @ [-rates[i, 1], rates[i, 0], 0.0])
        R_WI = plant.EvalBodyPoseInWorld(scratch, self._imu_link).rotation().matrix() @ self._R_LI
        rate = plant.EvalBodySpatialVelocityInWorld(scratch, self._imu_link).rotational() - self._rates(scratch, soles)
        return np.mean(ups, axis=0), rate + np.mean(turns, axis=0), R_WI

    def _reading(self, given: Inputs, held: FloatArray, scratch: Any) -> FloatArray:
        reading: FloatArray = np.asarray(given["imu"])
        seen = None if _finite(reading) else self._seen(given, held, scratch)
        return reading if seen is None else np.concatenate([seen[1] @ seen[2], np.full(3, np.nan)])

    def _imu_tilt(self, given: Inputs, held: FloatArray, scratch: Any) -> FloatArray:
        seen = None if _finite(np.asarray(given["imu"])) else self._seen(given, held, scratch)
        if seen is None:
            return _NO_TILT
        normal, rate, R_WI = seen
        up = R_WI[2]
        up = up - self._dt * np.cross(rate @ R_WI, up) + (self._dt / TILT_TIME) * (normal @ R_WI - up)
        x, y, z = (up / np.linalg.norm(up)).tolist()
        return np.array([np.arctan2(y, z), -np.arcsin(np.clip(x, -1.0, 1.0))])

    def _next(self, given: Inputs, held: FloatArray, scratch: Any) -> FloatArray:
        """x[n+1]."""
        after: FloatArray = np.empty(held.size)
        rates, readings = np.empty(self._n), (given["imu"], given["wrench"], given["cop"])
        state = given["estimated_state"]
        now = *readings, state, given["link_angle"]
        there = _ADVANCE(now, held, self._soles, self._options, (after, rates))
        if there and after[_SPEED] < RESTS and (soles := self._standing(given)):
            self._plant.SetPositions(scratch, state[: self._plant.num_positions()])
            moving = np.zeros(self._plant.num_velocities())
            moving[:3], moving[self._places] = after[self._turns], rates
            self._plant.SetVelocities(scratch, moving)
            after[_FLAG] = float(abs(self._rates(scratch, soles)[2]) > TURNING)
        return after
