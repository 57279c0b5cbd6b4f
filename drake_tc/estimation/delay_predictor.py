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

import numpy as np

from drake_tc.array_stage import Arrays, ArrayStage, StageSystem, places
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import copying
from drake_tc.types import Call

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
