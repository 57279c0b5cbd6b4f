"""`DisturbanceObserver`: joint motion without delay, and the torque that the drives lose beyond their models.

With A = M_jj(q) + J (links and rotors), u the commanded torque of the drives, friction as modelled taken off,
and p the link torque that the reference needs beside M qddot_d,

    A qddot = u - p - w - d                  d: friction, dead zone, gain errors ... that the drive's model lacks
    p = tau_ff - M qddot_d                   of the inverse dynamics at the reference: gravity, Coriolis, desired force
    w = (tau_hat - F tau_ff) + M (F qddot_d - qddot_hat)

w is what the links feel besides p, contact and wrong masses, as F/T sensors and IMU have it: the torque estimate and
the same filter F of the reference, both delayed alike, so that only their difference is old (without a filter, F = 1,
nothing is: `ObserverSpec.torque`). Leaving w out of d keeps the joint as soft against contacts as its gains say; an
observer without it would push back.

The encoder, which has no delay, corrects the model (third-order observer, all poles at z = exp(-bandwidth dt)):

    r       = q - q^[n]
    q', v'  = q^[n] + l1 r, v^[n] + l2 r;    d^[n+1] = clip(d^[n] - A l3 r, +/- limit)
    a       = A^-1 (u - p - w - d^[n+1])
    q^[n+1] = q' + dt v' + dt^2/2 a,  v^[n+1] = v' + dt a
    l1 = 1 - z^3,  l2 = 3/2 (1 - z)^2 (1 + z)/dt,  l3 = (1 - z)^3/dt^2

so that d^ = Q(s) d with Q of unit gain, third order and the stated bandwidth. Compensated, A of the model where the
joint has A', the effective inertia is A' (1 - Q) + A Q: 1 - Q (1 - A/A') has no zero in the right half-plane while
|Q| <= 1 and 0 < A < 2 A' (small gain), whatever delays Q; but where A/A' is small the joint feels like a third-order
integrator from A/A' times the bandwidth on, which no stiffness and damping can hold. The rotors' inertia is most of it
at the ends of a limb: it must be known, within a factor of two or so.

Encoder noise s (a sample) comes to about 0.6 A s bandwidth^2 sqrt(bandwidth dt) in d^.

Source: Ohnishi's disturbance observer (1987) in the state-space form of Gopinath and Luenberger; the split between w
and d is ours.

`JointInertia`: the links' mass matrix over the joints alone, at one configuration.

`DelayPredictor`: the estimates as they are now, with the identified drive model in place of the filters' delay.

The filters see the last N samples and answer for their middle, T = (N - 1)/2 dt ago (40 ms in Del Prete et al., 2016).
The drive model knows what the links got since then: with g its link torque (`DisturbanceObserver`), g_s the same behind
a low pass of `bandwidth`, and F the same filter with the same delay as the estimate's,

    tau_now = g_s + (tau_hat - F g_s)          tau_hat, F g_s: both T old

High frequencies come from the drive's model, low ones from F/T sensors and IMU; the bracket is the model's error,
and it is small, as the observer has corrected g by it already. g holds the command itself, one tick ago: fed back with
Kp, g without the low pass would put a pole at -Kp, unstable from Kp = 1 on. With it the pole is 1 - (1 + Kp) b,
b = 1 - exp(-bandwidth dt): 0.71 at 100 rad/s, 1 ms and Kp = 2.

Source: the Smith predictor (1957), as a complementary filter; the delay is an open problem of Del Prete et al. (2016).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from drake_tc.actuation.joint_effects import Models, model_list
from drake_tc.actuation.model import split_parts
from drake_tc.array_stage import Arrays, ArrayStage, StageSystem, places
from drake_tc.config.records import Checked, FromZero, Positive
from drake_tc.errors import ParamsError
from drake_tc.estimation.torque_model import as_slice
from drake_tc.kernels.calls import copying
from drake_tc.robot.plant import joint_limits, make_plant
from drake_tc.robot.robot import Robot
from drake_tc.types import Call, FloatArray


class JointInertia:
    """M_jj(q) (n, n) [kg m^2]: what the joints' torques accelerate while the base moves as it does. Holds constants."""

    def __init__(self, robot: Robot) -> None:
        """Build the model, without rotors: those belong to the drives.

        Raises:
            ParamsError: the URDF cannot be read.
        """
        self._plant: Any = make_plant(robot, 0.0)
        joints = [self._plant.GetJointByName(name) for name in robot.joints]
        self._positions = as_slice(np.array([joint.position_start() for joint in joints]))
        velocities = as_slice(np.array([joint.velocity_start() for joint in joints]))
        self._pick = (velocities, velocities) if isinstance(velocities, slice) else np.ix_(velocities, velocities)
        self._size = len(joints)

    def create_context(self) -> Any:
        """Scratch memory of `mass`."""
        return self._plant.CreateDefaultContext()

    def mass(self, context: Any, q: FloatArray) -> FloatArray:
        """M_jj at q (n,) [rad], as a view into Drake's matrix or a copy.

        Args:
            context: From `create_context`.
            q: Joint positions, finite.
        """
        positions = self._plant.GetPositions(context)
        positions[self._positions] = q
        self._plant.SetPositions(context, positions)
        return np.asarray(self._plant.CalcMassMatrix(context)[self._pick])


def known_inertia(joints: tuple[str, ...], own: FloatArray, given: dict[str, float]) -> FloatArray:
    """(n,) [kg m^2] of the drives: what is given by joint, else the models' own.

    Args:
        joints: Names.
        own: (n,) of the drives' models; 0 where they have none.
        given: Joint to inertia, from motor and gear data sheets.

    Raises:
        ParamsError: a joint that is not there, one without inertia, or a value that is no positive number.
    """
    for joint, value in given.items():
        if joint not in joints:
            raise ParamsError(f"rotor_inertia: no joint {joint!r}; joints: {', '.join(joints)}")
        if not (np.isfinite(value) and value > 0.0):
            raise ParamsError(f"rotor_inertia.{joint}: expected a positive number [kg m^2], got {value!r}")
    inertia = np.array([given.get(joint, value) for joint, value in zip(joints, own.tolist(), strict=True)])
    for joint, value in zip(joints, inertia.tolist(), strict=True):
        if not value > 0.0:
            raise ParamsError(
                f"rotor_inertia: expected that of {joint!r} [kg m^2], reflected to the joint, right within a factor of"
                " two: its drive's model has none; take it from the motor's and the gear's data sheets"
            )
    return inertia


LARGEST = 1e9
"""No input in SI units is as large; one that is counts as not finite."""


@dataclass(frozen=True)
class ObserverSpec(Checked):
    """What the observer is set to.

    Attributes:
        bandwidth: Bandwidth of the disturbance estimate d^ [rad/s].
        limit: Largest |d^| relative to the effort limit of the joint [-] (to 100 N m where it has none). It may exceed
            1, because a wrong gain or a late encoder looks like more friction than the torque of the drive.
        torque: Source of the torque w: "live", a second torque estimate from raw readings and from the observer's own
            motion, without delay (F is then 1); or "filtered", the delayed estimate of the controller, for a robot that
            touches nothing. In a rigid contact w follows u at once, so that a delay T of w makes a loop of Q (1 -
            exp(-T s)) with a gain of up to 2 |Q|: with 40 ms it is unstable above a bandwidth of about 60 rad/s.
        delay: Assumed delay of the filtered estimate [s]; None: that of the filters, which is right unless the sensors
            themselves are late.

    Raises:
        ParamsError: a number that is not possible.
    """

    bandwidth: Positive = 250.0
    limit: Positive = 1.5
    torque: Literal["live", "filtered"] = "live"
    delay: FromZero | None = None


def observer_gains(bandwidth: float, dt: float) -> tuple[float, float, float]:
    """(l1 [-], l2 [1/s], l3 [1/s^2]) with all three poles at exp(-bandwidth dt)."""
    z = math.exp(-bandwidth * dt)
    return 1.0 - z**3, 1.5 * (1.0 - z) ** 2 * (1.0 + z) / dt, (1.0 - z) ** 3 / dt**2


class DisturbanceObserver(StageSystem):
    """The observer of the module's docstring for all joints of a robot.

    Inputs:
        position (n): q as the encoders read it now [rad].
        commanded_torque (n): u of `TorqueControl` [N m], J_m qddot_d of the rotor inertia in the drives' models apart.
        command (n), sent_command (n): commands of TorqueControl and of the guard [rad | A | V | N m]; the
            difference over K goes to u.
        feedforward_torque (n): tau_ff of InverseDynamics [N m].
        reference (3n): [q_d; qdot_d; qddot_d].
        delayed_reference (2n): F [tau_ff; qddot_d].
        joint_estimate (3n), estimated_torque (n): delayed, of filter and torque estimator.
        compensated_motion (3n): what TorqueControl takes the velocity of viscous friction b from; b (qdot - v') goes
            to u.
        torque_fault (1): of the torque estimator; where it is not 0 the estimate counts as lost. Need not be connected.
    Outputs, of the state alone unless said otherwise:
        motion (3n): [q^; v^; a] now.
        disturbance (n): d^ [N m].
        compensation (n): d^ + (J - J_m) qddot_d [N m], to be added to the commanded torque of the drives; follows
            `reference` at the same instant.
        link_torque (n): u - J a - d^ [N m], what the links get.
        fault (1): 1 before the first tick, and where an input of the last one was not finite (or beyond `LARGEST`).
            `disturbance` and `compensation` are then 0; it starts anew with q^ = q, v^ = the filter's, d^ = 0.
    State: q^, v^, d^, a, link torque, fault: 5n + 1. Nothing is raised in the loop.
    """

    def __init__(
        self,
        robot: Robot,
        models: Models,
        spec: ObserverSpec,
        dt: float = 1e-3,
        *,
        rotor_inertia: Mapping[str, float] | None = None,
        fed_forward: bool = True,
    ) -> None:
        """Declare ports and build the model.

        Args:
            robot: Its links' masses.
            models: The drives as the controller takes them, one a joint, by joint or in the order of `robot.joints`.
            spec: Bandwidth, limit, delay.
            dt: Period [s].
            rotor_inertia: Joint to J [kg m^2], as motor and gear data sheets have it; its model's where not given.
            fed_forward: TorqueControl compensates the models' rotor inertia with the reference acceleration.

        Raises:
            ParamsError: sizes that do not agree, a period that is not possible, a joint without rotor inertia.
        """
        super().__init__()
        n, self._joints = len(robot.joints), tuple(robot.joints)
        models = model_list(models, robot.joints)
        if not (math.isfinite(dt) and dt > 0.0):
            raise ParamsError(f"dt: expected a positive period [s], got {dt!r}")
        own = np.array([model.inertia for model in models])
        self._rotor = known_inertia(robot.joints, own, dict(rotor_inertia or {}))
        self._modelled = own if fed_forward else np.zeros(n)
        self._missing = self._rotor - self._modelled
        self._damping = np.array([split_parts(model)[0][1] for model in models])
        self._per_gain = 1.0 / np.array([model.drive.gain for model in models])
        effort = joint_limits(robot).effort
        self._limit = spec.limit * np.where(np.isfinite(effort), effort, 100.0)
        self._inertia, self._size, self._dt = JointInertia(robot), n, float(dt)
        self._gains = observer_gains(spec.bandwidth, dt)
        self._declare_ports(n)

    def _declare_ports(self, n: int) -> None:
        sizes = {"position": n, "commanded_torque": n, "command": n, "sent_command": n}
        sizes |= {"feedforward_torque": n, "reference": 3 * n, "delayed_reference": 2 * n}
        sizes |= {"joint_estimate": 3 * n, "estimated_torque": n, "compensated_motion": 3 * n}
        self._seen = tuple(sizes)
        self._declare({**sizes, "torque_fault": 1})

    @property
    def rotor_inertia(self) -> FloatArray:
        """(n,) J [kg m^2]."""
        return self._rotor.copy()

    def coordinate_names(self) -> tuple[str, ...]:
        """Of the state, for linearisations: "joint/estimated_position" and the like, and "fault"."""
        parts = ("estimated_position", "estimated_velocity", "disturbance", "acceleration", "link_torque")
        return (*(f"{joint}/{part}" for part in parts for joint in self._joints), "fault")

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        n, start = self._size, np.zeros(5 * self._size + 1)
        start[-1] = 1.0

        def bind_early(arrays: Arrays) -> tuple[Call, None]:
            return copying(arrays.before, arrays.out), None

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            held, x, out, scratch = arrays.before, arrays.after, arrays.out, self._inertia.create_context()
            seen = [arrays.inputs[name] for name in self._seen]
            desired, fault = arrays.inputs["reference"][2 * n :], arrays.inputs.get("torque_fault", np.zeros(1))

            def outputs(time: float) -> None:
                sound = held[-1] == 0.0 and np.abs(desired).max() < LARGEST
                out[:] = held[3 * n : 4 * n] + self._missing * desired if sound else 0.0

            def update(time: float) -> None:
                if fault[0] != 0.0 or not np.abs(np.concatenate(seen)).max() < LARGEST:  # also where one is NaN
                    x[:], x[-1] = 0.0, 1.0
                    return
                if x[-1]:
                    x[:n], x[n : 2 * n], x[2 * n :] = seen[0], seen[7][n : 2 * n], 0.0
                self._advance(scratch, x, seen)

            return outputs, update

        parts = {"motion": slice(3 * n), "disturbance": slice(3 * n, 4 * n), "link_torque": slice(4 * n, 5 * n)}
        early = ArrayStage(5 * n + 1, places(parts | {"fault": slice(5 * n, 5 * n + 1)}), bind_early)
        ports, reads = places({"compensation": slice(n)}), frozenset({"reference"})
        updates = frozenset({*self._seen, "torque_fault"})
        return ArrayStage(n, ports, bind, reads, updates, start, self._dt, early)

    def _advance(self, scratch: Any, x: FloatArray, seen: list[FloatArray]) -> None:
        """One tick of the recursion, in place; x = [q^; v^; a; d^; link torque; fault]."""
        n, dt = self._size, self._dt
        q, asked, command, sent, feedforward, reference, delayed, estimate, torque, used = seen
        desired = reference[2 * n :]
        mass = self._inertia.mass(scratch, q)
        total = mass.copy()
        total.flat[:: n + 1] += self._rotor
        # p + w, with M times all accelerations at once
        load = feedforward + torque - delayed[:n] + mass.dot(delayed[n:] - estimate[2 * n :] - desired)
        r = q - x[:n]
        l1, l2, l3 = self._gains
        here = x[:n] + l1 * r
        speed = x[n : 2 * n] + l2 * r
        u = asked + self._modelled * desired + (sent - command) * self._per_gain
        u += self._damping * (used[n : 2 * n] - speed)
        lost = np.minimum(np.maximum(x[3 * n : 4 * n] - l3 * total.dot(r), -self._limit), self._limit)
        rate = np.linalg.solve(total, u - load - lost)
        x[:n] = here + dt * (speed + 0.5 * dt * rate)
        x[n : 2 * n] = speed + dt * rate
        x[2 * n : 3 * n] = rate
        x[3 * n : 4 * n] = lost
        x[4 * n : 5 * n] = u - self._rotor * rate - lost


@dataclass(frozen=True)
class PredictorSpec(Checked):
    """What the predictor is set to.

    Attributes:
        bandwidth: Bandwidth of the low pass on the torque of the drive model [rad/s].

    Raises:
        ParamsError: not a positive number.
    """

    bandwidth: Positive = 100.0


class DelayPredictor(StageSystem):
    """tau_now and the joints' motion now, or the delayed ones while the model cannot be trusted.

    Inputs:
        estimated_torque (n): tau_hat, delayed [N m].
        joint_estimate (3n): [q; qdot; qddot], delayed.
        delayed_model_torque (n): F g_s [N m], of a filter behind `model_torque`.
        link_torque (n), motion (3n), fault (1): of a DisturbanceObserver.
        position (n): q as the encoders read it now [rad].
    Outputs; but for `model_torque` with direct feedthrough of every input:
        estimated_torque (n): tau_now [N m].
        joint_estimate (3n): the observer's motion.
        position (n): q^ of that motion, without the encoder's quantisation.
        model_torque (n): g_s [N m], of the state alone; to be filtered as the torque's sensors are.
        fault (1): 1 where the observer has a fault, or an input is not finite (or beyond `LARGEST`); the outputs are
            then tau_hat, the delayed joint_estimate and the raw position, as without a predictor.

        g_s[n+1] = g_s[n] + (1 - exp(-bandwidth dt)) (g[n] - g_s[n]);     g_s[n+1] = tau_hat while there is a fault
    """

    def __init__(self, size: int, spec: PredictorSpec, dt: float = 1e-3) -> None:
        """Declare ports and state.

        Args:
            size: Joints n.
            spec: Its bandwidth.
            dt: Period [s].

        Raises:
            ParamsError: a size below 1, or a period that is not positive.
        """
        super().__init__()
        if size < 1:
            raise ParamsError(f"DelayPredictor: expected at least one joint, got {size}")
        if not (math.isfinite(dt) and dt > 0.0):
            raise ParamsError(f"dt: expected a positive period [s], got {dt!r}")
        n = self._size = size
        self._blend, self._dt = -math.expm1(-spec.bandwidth * dt), float(dt)
        sizes = {"estimated_torque": n, "joint_estimate": 3 * n, "delayed_model_torque": n}
        self._declare(sizes | {"link_torque": n, "motion": 3 * n, "fault": 1, "position": n})

    def coordinate_names(self) -> tuple[str, ...]:
        """Of the state, for linearisations: "model_torque[i]"."""
        return tuple(f"model_torque[{i}]" for i in range(self._size))

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        n = self._size
        names = ("estimated_torque", "joint_estimate", "delayed_model_torque", "motion", "position")

        def bind_early(arrays: Arrays) -> tuple[Call, None]:
            return copying(arrays.before, arrays.out), None

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            given, held, after = arrays.inputs, arrays.before, arrays.after
            torque, delayed, old, motion, position = seen = [given[name] for name in names]
            link, faulty, out = given["link_torque"], given["fault"], arrays.out

            def outputs(time: float) -> None:
                sound = faulty[0] == 0.0 and np.abs(np.concatenate((*seen, link))).max() < LARGEST
                out[:n] = torque + held - old if sound else torque
                out[n : 4 * n] = motion if sound else delayed
                out[4 * n : 5 * n] = motion[:n] if sound else position
                out[-1] = not sound

            def update(time: float) -> None:
                if out[-1]:
                    after[:] = np.where(np.abs(torque) < LARGEST, torque, 0.0)
                else:
                    after[:] = held + self._blend * (link - held)

            return outputs, update

        early = ArrayStage(n, places({"model_torque": slice(n)}), bind_early)
        ports = places({"estimated_torque": slice(n), "joint_estimate": slice(n, 4 * n)})
        ports |= places({"position": slice(4 * n, 5 * n), "fault": slice(5 * n, 5 * n + 1)})
        reads = frozenset({*names, "link_torque", "fault"})
        return ArrayStage(5 * n + 1, ports, bind, reads, start=np.zeros(n), period=self._dt, early=early)
