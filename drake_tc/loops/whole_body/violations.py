"""Which limits the simulated robot itself broke: its true contact wrenches, torques, positions and velocities."""

import numpy as np
from scipy.ndimage import uniform_filter1d

from drake_tc.loops.whole_body.references import contact_source
from drake_tc.loops.whole_body.running import TsidRecording
from drake_tc.robot.plant import joint_limits
from drake_tc.tsid.limits.wrench_cone import WrenchCones
from drake_tc.types import BoolArray, FloatArray


def contact_wrenches(recording: TsidRecording, every: int = 1) -> FloatArray:
    """(S, K) true forces of all contacts, in their `axes` [N, N m]: what J^T f = (generalized contact forces) leaves.

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


def contact_misses(recording: TsidRecording, every: int = 1, window: int = 1) -> FloatArray:
    """(S,) by how much the worst row of all cones is missed by the true wrenches [N, N m]; negative: none is.

    The cones are the controller's, "inner" ones where it has none. A contact counts while the scenario does not lift
    it.

    Args:
        recording: Of the run.
        every: One sample in so many.
        window: Wrenches are means of so many samples around each.
    """
    law, model = recording.law, recording.law.model
    wrenches = contact_wrenches(recording, every if window == 1 else 1)
    if window > 1:
        wrenches = uniform_filter1d(wrenches, window, axis=0, mode="nearest")[::every]
    cones = next((limit for limit in law.limits if isinstance(limit, WrenchCones)), WrenchCones(model.contacts))
    scratch, worst = model.create_scratch(), []
    carrying = _carrying(recording)[::every].tolist()
    for state, wrench, active in zip(recording["state"][::every], wrenches, carrying, strict=True):
        terms = model.terms(scratch, state[: model.nq], state[model.nq :], tuple(active))
        rows, force = cones.rows(terms), wrench[terms.contacts.entries]
        value = force if rows.matrix.force is None else rows.matrix.force @ force
        worst.append(np.maximum(rows.lower - value, value - rows.upper).max(initial=-np.inf))
    return np.array(worst)


def _carrying(recording: TsidRecording) -> BoolArray:
    """(T, contacts) which the scenario does not lift."""
    scenario, law = recording.scenario, recording.law
    source = contact_source(law.model.contacts, scenario.lifted, scenario.duration, law.period)
    context, found = source.CreateDefaultContext(), []
    for instant in recording.time:
        context.SetTime(instant)
        found.append(np.asarray(source.get_output_port().Eval(context)) > 0.5)
    return np.array(found)


def joint_misses(recording: TsidRecording) -> dict[str, FloatArray]:
    """(T,) each: by how much the worst joint misses its limit; negative: none does.

    "torque": what the joints got, against the effort limits [N m]; "position", "velocity" [rad, rad/s].

    Args:
        recording: Of the run.
    """
    model = recording.law.model
    limits = joint_limits(model.robot)
    position = recording["state"][:, model.positions]
    velocity = recording["state"][:, model.nq + model.actuated]
    return {
        "torque": (np.abs(recording["applied_torque"]) - limits.effort).max(axis=1),
        "position": np.maximum(position - limits.upper, limits.lower - position).max(axis=1),
        "velocity": (np.abs(velocity) - limits.velocity).max(axis=1),
    }


def worst_misses(recording: TsidRecording, every: int = 1, since: float = 0.1) -> dict[str, float]:
    """By how much each kind of limit was missed at worst, in its rows' unit; 0 or negative: never.

    "contact": see `contact_misses`; "torque", "position", "velocity": see `joint_misses`.

    Args:
        recording: Of the run.
        every: One sample in so many is looked at for contacts.
        since: Contacts count from here on [s]: the soles start above the floor, without load.
    """
    contact = contact_misses(recording, every)[recording.time[::every] >= since]
    joints = {name: float(missed.max()) for name, missed in joint_misses(recording).items()}
    return {"contact": float(contact.max(initial=-np.inf)), **joints}
