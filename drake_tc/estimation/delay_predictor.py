"""`DelayPredictor`: the estimates as they are now, with the identified drive model in place of the filters' delay.

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
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem, ValueProducer

from drake_tc.array_stage import PortMethods
from drake_tc.errors import ParamsError

LARGEST = 1e9
"""No input in SI units is as large; one that is counts as not finite."""


@dataclass(frozen=True)
class PredictorSpec:
    """What the predictor is set to.

    Attributes:
        bandwidth: Bandwidth of the low pass on the torque of the drive model [rad/s].

    Raises:
        ParamsError: not a positive number.
    """

    bandwidth: float = 100.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.bandwidth) and self.bandwidth > 0.0):
            raise ParamsError(f"predictor.bandwidth: expected a positive number [rad/s], got {self.bandwidth!r}")


class DelayPredictor(PortMethods, LeafSystem):
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
        self._blend = -math.expm1(-spec.bandwidth * dt)
        sizes = {"estimated_torque": n, "joint_estimate": 3 * n, "delayed_model_torque": n}
        sizes |= {"link_torque": n, "motion": 3 * n, "fault": 1, "position": n}
        ports: dict[str, Any] = {name: self.DeclareVectorInputPort(name, width) for name, width in sizes.items()}
        self._torque, self._delayed = ports["estimated_torque"], ports["joint_estimate"]
        self._old, self._link, self._motion = (ports[k] for k in ("delayed_model_torque", "link_torque", "motion"))
        self._fault, self._position = ports["fault"], ports["position"]
        state = self.DeclareDiscreteState(n)
        self._state = int(state)
        own = self.discrete_state_ticket(state)
        inputs = {port.ticket() for port in ports.values()}
        self._verdict: Any = self.DeclareCacheEntry(
            "sound", ValueProducer(allocate=Value(()).Clone, calc=self._judge), inputs
        )
        everything = {own, self._verdict.ticket(), *inputs}
        self.DeclareVectorOutputPort("estimated_torque", n, self._write_torque, everything)
        self.DeclareVectorOutputPort("joint_estimate", 3 * n, self._write_motion, everything)
        self.DeclareVectorOutputPort("position", n, self._write_position, everything)
        self.DeclareStateOutputPort("model_torque", state)
        self.DeclareVectorOutputPort("fault", 1, self._write_fault, everything)
        self.DeclarePeriodicDiscreteUpdateEvent(float(dt), 0.0, self._update)

    def _judge(self, context: Any, verdict: Any) -> None:
        """Whether the model can be trusted, into the cache entry."""
        if self._fault.Eval(context)[0] != 0.0:
            verdict.set_value(False)
            return
        seen = (self._torque, self._old, self._link, self._motion, self._position, self._delayed)
        verdict.set_value(bool(np.abs(np.concatenate([port.Eval(context) for port in seen])).max() < LARGEST))

    def _sound(self, context: Any) -> bool:
        return bool(self._verdict.Eval(context))

    def _write_torque(self, context: Any, vector: Any) -> None:
        torque = self._torque.Eval(context)
        if self._sound(context):
            torque = torque + context.get_discrete_state(self._state).value() - self._old.Eval(context)
        vector.set_value(torque)

    def _write_motion(self, context: Context, vector: Any) -> None:
        vector.set_value((self._motion if self._sound(context) else self._delayed).Eval(context))

    def coordinate_names(self) -> tuple[str, ...]:
        """Of the state, for linearisations: "model_torque[i]"."""
        return tuple(f"model_torque[{i}]" for i in range(self._size))

    def _write_position(self, context: Context, vector: Any) -> None:
        sound = self._sound(context)
        vector.set_value(self._motion.Eval(context)[: self._size] if sound else self._position.Eval(context))

    def _write_fault(self, context: Context, vector: Any) -> None:
        vector.set_value(np.array([0.0 if self._sound(context) else 1.0]))

    def _update(self, context: Any, values: DiscreteValues) -> None:
        torque = np.asarray(self._torque.Eval(context))
        held = context.get_discrete_state(self._state).value()
        if self._sound(context):
            after = held + self._blend * (self._link.Eval(context) - held)
        else:
            after = np.where(np.abs(torque) < LARGEST, torque, 0.0)
        target: Any = values
        target.set_value(self._state, after)
