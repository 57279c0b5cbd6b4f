"""The truth signal: what the declared model leaves unexplained in noise-free channels, in newton metres.

    u = y/K - (tau + J_declared a + B v + C s)

with y, tau, a, v as the rig's sensors would give them without noise, K, B, C the true constants and s the true
bristle state. One formula for every cause, of mechanics, drive or sensor: whatever it is, u is what it does.
"""

import numpy as np

from drake_tc.joint_simulator.measurement import CleanLog, clean_log
from drake_tc.joint_simulator.physics import Record
from drake_tc.types import BoolArray, FloatArray

MOVING_SPEED = 0.02  # [rad/s]: below it, strength is not measured


def unmodelled_torque(record: Record, log: CleanLog) -> FloatArray:
    """U of the module's equation, (T,) [N m]."""
    joint = record.spec.joint
    modelled = log.torque + record.spec.declared_inertia * log.acceleration
    modelled = modelled + joint.damping * log.velocity + joint.coulomb * log.bristle
    return np.asarray(log.effort / joint.gain - modelled)


def beyond_refit(records: list[Record]) -> float:
    """RMS [N m] of u over moving samples, after refitting gain, viscous and Coulomb in all the runs together.

    The refit is the projection onto [tau + J a, v, s]: a joint whose K, B, C were wrong could not be told from it.
    """
    columns, targets = [], []
    for record in records:
        log = clean_log(record)
        moving: BoolArray = np.abs(log.velocity) > MOVING_SPEED
        unknown = unmodelled_torque(record, log)
        known = log.torque + record.spec.declared_inertia * log.acceleration
        columns.append(np.stack([known, log.velocity, log.bristle], axis=1)[moving])
        targets.append(unknown[moving])
    design, target = np.concatenate(columns), np.concatenate(targets)
    solution = np.linalg.lstsq(design, target, rcond=None)[0]
    return float(np.sqrt(np.mean((target - design @ solution) ** 2)))
