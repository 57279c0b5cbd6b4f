"""What all joints of a robot have to be told: a note of the robot, once, in place of one of each joint."""

from collections.abc import Mapping
from dataclasses import replace

from drake_tc.diagnosis.notes import Note
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.timing_notes import AllRecordedLate, RecordedLate


def common_notes(joints: Mapping[str, JointResult]) -> tuple[dict[str, JointResult], tuple[Note, ...]]:
    """(results, notes): efforts that all of several joints record late by the same time are a note of the robot.

    Args:
        joints: Results by joint.

    Returns:
        The results without what the notes say, and the notes.
    """
    late = [[note for note in joint.notes if isinstance(note, RecordedLate)] for joint in joints.values()]
    if len(joints) < 2 or len({note.lead for each in late for note in each}) != 1 or not all(late):
        return dict(joints), ()
    drives = {note.drive for each in late for note in each}
    note = AllRecordedLate(drives.pop() if len(drives) == 1 else None, late[0][0].lead)
    return {name: _without(joint) for name, joint in joints.items()}, (note,)


def _without(joint: JointResult) -> JointResult:
    """The result without its own notes on an effort that is recorded late."""
    notes, of_load = (
        tuple(note for note in each if not isinstance(note, RecordedLate)) for each in (joint.notes, joint.load_notes)
    )
    return replace(joint, notes=notes, load_notes=of_load)
