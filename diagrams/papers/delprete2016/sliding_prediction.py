"""What the linear loop says of a joint that was pushed and slides on its feedforward: `A.stability` before simulating.

In sliding, dry friction and dead zone are one constant drag D = Fc + w/K_tau, so the joint's speed obeys

    v(t) - v_c = (v(0) - v_c) rho^(t/h),     v_c = D/(K_v'/K_tau - b)

with rho the largest eigenvalue of the speed's loop. Where the feedforward over-estimates viscous friction, rho > 1 and
the joint runs away from any speed above v_c ("as soon as a certain velocity is reached"); below, its friction wins.
"""

from dataclasses import dataclass, replace

from drake_tc.loops.torque.default_gains import joint_loops
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.stages import actuator_models, loop_robot
from drake_tc.registry import diagram_entry


@dataclass(frozen=True)
class SlidingPrediction:
    """One joint, one direction.

    Attributes:
        spectral_radius: rho, gravity's own slow stiffness left out.
        critical_speed: v_c [rad/s]; negative where no speed makes the joint run away.
        ticks_per_second: 1/h.
    """

    spectral_radius: float
    critical_speed: float
    ticks_per_second: float

    def growth(self, speed: float, duration: float) -> float:
        """Speed after `duration` [s] over that at the start, 0 where the joint comes to rest before."""
        share = self.critical_speed / speed
        grown: float = self.spectral_radius ** (duration * self.ticks_per_second)
        return max(0.0, share + (1.0 - share) * grown)


def floating(joint: str, model: str) -> Scenario:
    """The leg held but for one joint, which has no feedback at all; compensated by one of the fits.

    Args:
        joint: Which floats.
        model: "symmetric" or "asymmetric".
    """
    scenario: Scenario = diagram_entry("hrp2_leg").scenario("float")
    free = {joint: {"k6": 0.0, "k7": 0.0, "kp": 0.0}}
    return replace(
        scenario,
        model=f"../models/hrp2_like/hrp2_like_leg_{model}.yaml",
        gains=replace(scenario.gains, by_joint=free),
    )


def predicted(joint: str, model: str, direction: float) -> SlidingPrediction:
    """In closed form (`JointLoop`).

    Args:
        joint: Which floats.
        model: "symmetric" or "asymmetric": which fit the feedforward comes from.
        direction: Of its motion: 1, -1, or 0 for the mean of the drive's two gains.
    """
    scenario = floating(joint, model)
    loop = replace(joint_loops(scenario, direction)[joint], gravity_stiffness=0.0, sensed_gravity=0.0)
    effects = {value.key: value.parameters for value in actuator_models(scenario, loop_robot(scenario))[joint].effects}
    drag: float = effects["coulomb"]["coulomb"] + effects["deadzone"]["deadzone"] / loop.k_tau
    surplus = float((loop.k_v_model - loop.k_v) / loop.k_tau)
    return SlidingPrediction(loop.spectral_radius(), drag / surplus, 1.0 / loop.dt)
