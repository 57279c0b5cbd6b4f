"""Which terms of the simulator make up which cause; causes of sensors and transmission have none."""

from collections.abc import Mapping

from drake_tc.joint_simulator import terms_joint as drive
from drake_tc.joint_simulator import terms_joint as friction
from drake_tc.joint_simulator import terms_load as load
from drake_tc.joint_simulator import terms_load as outside
from drake_tc.joint_simulator.spec import RigSpec
from drake_tc.joint_simulator.terms import Term

TERMS: Mapping[str, tuple[type[Term], ...]] = {
    "rotor_inertia": (),
    "stribeck": (friction.Stribeck,),
    "quadratic_viscous": (friction.QuadraticViscous,),
    "load_dependent_friction": (friction.LoadDependent,),
    "asymmetric_friction": (friction.AsymmetricLevel, friction.AsymmetricViscous),
    "presliding_hysteresis": (friction.SlowBristle,),
    "position_dependent_friction": (friction.PositionDependent,),
    "thermal_friction": (friction.ThermalLevel, friction.ThermalViscous),
    "torque_ripple": (load.TorqueRipple,),
    "cable_spring": (load.CableSpring,),
    "backlash": (),
    "elasticity": (),
    "deadzone": (drive.Deadzone,),
    "saturation": (drive.Saturation,),
    "servo_integrator": (drive.ServoIntegrator,),
    "velocity_sign_switch": (drive.VelocitySignSwitch,),
    "delay": (),
    "command_delay": (drive.CommandDelay,),
    "effort_delay": (drive.EffortDelay,),
    "current_lag": (drive.CurrentLag,),
    "payload": (),
    "torque_sensor_bias": (),
    "torque_sensor_gain": (),
    "torque_sensor_drift": (),
    "encoder_offset": (),
    "encoder_eccentricity": (),
    "touch": (load.Touch,),
    "periodic_disturbance": (load.PeriodicDisturbance,),
    "unrecorded_supply_sag": (drive.SupplySag,),
    "position_velocity_friction": (load.PositionTimesVelocity,),
    "detent": (load.Detent,),
    "ageing": (load.Ageing,),
    "triangular_cam": (load.TriangularCam,),
    "random_disturbance": (outside.RandomDisturbance,),
    "long_touch": (outside.LongTouch,),
    "wandering_sensor": (),
    "end_stop": (outside.EndStop,),
    "load_times_speed": (outside.LoadTimesSpeed,),
    "drive_dropout": (outside.DriveDropout,),
    "friction_jump": (outside.FrictionJump,),
}


def simulated_causes(spec: RigSpec) -> dict[str, Mapping[str, float]]:
    """The rig's causes as the simulator names them: a delay acts on q_d in a servo, on the effort elsewhere."""
    delay = "command_delay" if spec.joint.drive == "position_servo" else "effort_delay"
    return {delay if cause == "delay" else cause: values for cause, values in spec.causes.items()}
