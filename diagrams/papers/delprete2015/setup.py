"""Del Prete and Mansard (2015), section VII.

The 30-joint robot on both feet, its limits, the numbers of Table I, five ways to control.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from drake_tc.robot.fields import Mount, Pose
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.limits import AccelerationLimit, TorqueLimit, WrenchCones
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.robust.formulation import Formulation, MeasureName
from drake_tc.tsid.robust.scaled import Options, TorqueError
from drake_tc.tsid.rows import Limit
from drake_tc.tsid.tasks import ForceTask, PostureTask

DT = 0.005
"""Of simulation and controller [s]."""
ACCELERATION, VELOCITY = 100.0, 0.5
"""Largest of every joint [rad/s^2, rad/s]."""
FRICTION, MOMENT_FRICTION, MINIMUM_FORCE = 0.3, 0.1, 1.0
"""Of a foot: mu, mu_m [m], f_min [N]."""
SIGMA = 0.003
"""Standard deviation of a joint's torque, of its largest torque."""
ACCURACY = 1e-10
"""Of R, to which a torque is found. With w = 1, R saturates, and what is left open decides how well the posture, of
weight 1e-6, is kept: with the library's 1e-6 a motion of four seconds still depends on it."""
W_COM, W_REACH = 1e-5, 1.0
"""Weight w of the robustness in tests 1 and 2, and in the others."""
W_FORCE, FORCE_COMPONENTS = 1e-4, (1.0, 1.0, 1e-3, 2.0, 2.0, 2.0)
KP_TASK, KD_TASK = 100.0, 20.0
"""Of the centre of mass; the paper prints none for the hand, which takes the same."""
HAND = "right_hand"
"""Name of the frame that reaches."""

SETTING = (
    "Simulated: the 30-joint model on both soles, which are held rigidly, first-order Euler at 5 ms, the numbers of"
    " Table I. Its model has the motors' reflected inertias: without them the paper's sigma shakes a gripper by 331"
    " rad/s^2."
)
_FOLDER = Path(__file__).resolve().parents[3] / "models" / "hrp2_like"


def _sole(side: str) -> Contact:
    """C under the ankle, where the robot file has it; the sole between the four spheres of the model's foot.

    The paper prints neither; where C is matters to the force regularisation alone, which draws the pressure to it.
    """
    place = Mount(f"{side}_sole", f"{side[0]}_foot", Pose((0.0, 0.0, -0.055)))
    return Contact(
        place.name,
        place,
        extents=(-0.075, 0.135, -0.0575, 0.0575),
        friction=FRICTION,
        moment_friction=MOMENT_FRICTION,
        minimum_force=MINIMUM_FORCE,
    )


SOLES = (_sole("right"), _sole("left"))


@dataclass(frozen=True)
class Way:
    """One way to choose torques.

    Attributes:
        name: As the paper's tables have it.
        measure: Of robustness.
        force_weight: w_f of the force regularisation; 0 for none.
    """

    name: str
    measure: MeasureName
    force_weight: float = 0.0

    def formulation(self, weight: float) -> Formulation:
        """With weight w of the robustness."""
        return Formulation(self.measure, weight=weight, options=Options(accuracy=ACCURACY))


PLAIN = Way("classic, w_f = 0", "classic")
CLASSIC = Way("classic, w_f > 0", "classic", W_FORCE)
INDIVIDUAL, BOX, RECTANGLE = Way("p_ind", "individual"), Way("p_box", "box"), Way("p_rect", "rectangle")
WAYS = (PLAIN, CLASSIC, INDIVIDUAL, BOX, RECTANGLE)
ROBUST = (INDIVIDUAL, RECTANGLE, BOX)


@cache
def robot() -> Robot:
    """The robot, floating."""
    return load_robot(_FOLDER / "hrp2_like.yaml")


def make_model(machine: Robot) -> TsidModel:
    """Model of the robot, or of one with other masses: its soles, its right hand, the rotors of its actuator file."""
    return TsidModel(machine, SOLES, frames=[Mount(HAND, "r_hand", Pose((0.0, 0.0, -0.07)))])


@cache
def model() -> TsidModel:
    """Of the robot as it is."""
    return make_model(robot())


@cache
def torque_error(share: float = SIGMA) -> TorqueError:
    """Of e ~ N(0, Sigma), sigma = share x tau_max of each joint."""
    return TorqueError((share * joint_limits(robot()).effort) ** 2)


def standing_limits() -> tuple[Limit, ...]:
    """60 sides for the torques, 22 for the feet, 60 for the accelerations with positions and velocities folded in.

    The friction pyramid is |f_x|, |f_y| <= mu f_z, as Table I has mu.
    """
    of = model()
    return (
        TorqueLimit.of(robot()),
        WrenchCones(SOLES, pyramid="outer"),
        AccelerationLimit.of(of, period=DT, acceleration=ACCELERATION, velocity=VELOCITY),
    )


def posture_task(of: TsidModel) -> PostureTask:
    """w_post = 1e-3, Kp = Kd = 1."""
    return PostureTask(of, 1.0, 1.0, weight=1e-3)


def force_task(of: TsidModel, weight: float) -> ForceTask:
    """The force regularisation of the paper's ref. 33."""
    return ForceTask(of, weight=weight, components=FORCE_COMPONENTS)
