"""Effects of the library that a rig file may declare; `logs` must not import the library, so a test compares the two.

Effects of other packages are known by their names in `drake_tc.extensions.EFFECTS`.
"""

EFFECT_IDS = (
    *("viscous", "coulomb", "rotor_inertia", "stribeck", "quadratic_viscous", "load_dependent_friction"),
    *("asymmetric_friction", "presliding_hysteresis", "position_dependent_friction", "thermal_friction"),
    *("torque_ripple", "cable_spring", "backlash", "elasticity", "deadzone", "saturation", "servo_integrator"),
    *("velocity_sign_switch", "delay", "current_lag", "payload", "torque_sensor_bias", "torque_sensor_gain"),
    *("torque_sensor_drift", "effort_bias", "encoder_offset", "encoder_eccentricity", "encoder_ripple"),
    *("directional_efficiency", "position_dependent_load", "supply_sag", "winding_temperature", "servo_gain"),
    "static_friction",
    *("load_stribeck", "drive_compression", "winding_heat", "load_tilt", "gain_ripple"),
    *("saturation.servo", "current_lag.command"),
)

ROBOT_CAUSES = ("link_mass", "link_com", "ft_bias", "ft_gain", "imu_bias")
"""Causes that no single joint owns; they can be found, but not declared."""
