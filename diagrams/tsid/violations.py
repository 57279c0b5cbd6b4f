"""Which limits the simulated robot itself broke: its true contact wrenches, torques, positions and velocities."""

import numpy as np
from drake_tc.diagrams.tsid.running import TsidRecording

from drake_tc.robot.plant import joint_limits
from drake_tc.tsid.limits.wrench_cone import Pyramid, cone_rows
from drake_tc.types import FloatArray


def contact_wrenches(recording: TsidRecording, every: int = 1) -> FloatArray:
    """(S, K) true forces of all contacts, in their axes [N, N m]: what J^T f = (generalized contact forces) leaves.

    The robot touches the floor with its contacts alone, so f is exact where J has full row rank, and of least norm
    else. Contacts that the controller lifts may touch as well, so all of them count.

    Args:
        recording: Of the run.
        every: One sample in so many.
    """
    model = recording.law.model
    scratch = model.create_scratch()
    found = []
    for state, force in zip(recording["state"][::every], recording["contact"][::every], strict=True):
        terms = model.terms(scratch, state[: model.nq], state[model.nq :])
        found.append(np.linalg.lstsq(terms.contact_jacobian.T, force, rcond=None)[0])
    return np.array(found)


def contact_misses(recording: TsidRecording, every: int = 1, pyramid: Pyramid = "inner") -> FloatArray:
    """(S,) by how much the worst row of all cones is missed by the true wrenches [N, N m]; negative: none is.

    A contact counts while the controller pushes with it.

    Args:
        recording: Of the run.
        every: One sample in so many.
        pyramid: Of friction, inside or around the round cone.
    """
    wrenches, wanted = contact_wrenches(recording, every), recording["contact_force"][::every]
    worst, first = np.full(len(wrenches), -np.inf), 0
    for contact in recording.law.model.contacts:
        place = slice(first, first + contact.size)
        matrix, lower, upper, _ = cone_rows(contact, pyramid)
        value = wrenches[:, place] @ matrix.T
        missed = np.maximum(lower - value, value - upper).max(axis=1)
        carries = wanted[:, first + 2] > 0.0
        worst[carries] = np.maximum(worst[carries], missed[carries])
        first = place.stop
    return worst


def worst_misses(recording: TsidRecording, every: int = 1, since: float = 0.1) -> dict[str, float]:
    """By how much each kind of limit was missed at worst, in its rows' unit; 0 or negative: never.

    "contact": see `contact_misses`; "torque": what the joints got against the effort limits [N m]; "position",
    "velocity": of the joints [rad, rad/s].

    Args:
        recording: Of the run.
        every: One sample in so many is looked at for contacts.
        since: Contacts count from here on [s]: the soles start above the floor, without load.
    """
    model = recording.law.model
    limits = joint_limits(model.robot)
    position = recording["state"][:, model.positions]
    velocity = recording["state"][:, model.nq + model.actuated]
    return {
        "contact": float(contact_misses(recording, every)[recording.time[::every] >= since].max(initial=-np.inf)),
        "torque": float((np.abs(recording["applied_torque"]) - limits.effort).max()),
        "position": float(np.maximum(position - limits.upper, limits.lower - position).max()),
        "velocity": float((np.abs(velocity) - limits.velocity).max()),
    }
