"""Which topic of a bag is measured, which commanded, and whose rows are the samples."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import LogError
from drake_tc.logs.files.readers import read_table
from drake_tc.logs.inspection import inspect_log, trial
from drake_tc.logs.prepare import load_run
from drake_tc.logs.rig import parse_rig

from .recorded import bag, joint_states

TIME = np.arange(1000) / 250.0
MEASURED, VELOCITY = np.sin(3.0 * TIME), 3.0 * np.cos(3.0 * TIME)
EFFORT = 0.5 * np.cos(3.0 * TIME) + 0.3 * MEASURED
TORQUE_DRIVE = {
    "joint": "knee",
    "drive": "torque",
    "load": "unknown",
    "columns": {"knee/torque_command": "knee/effort"},
}


def with_topic(path, topic, *, state="/joint_states", often=TIME):
    """The joint states, and on another topic the same joint with 1 rad more, more often."""
    return bag(
        path,
        joint_states(state, TIME, {"knee": (MEASURED, VELOCITY, EFFORT)}),
        joint_states(topic, often, {"knee": (1.0 + np.sin(3.0 * often), 3.0 * np.cos(3.0 * often))}),
    )


@pytest.mark.parametrize(
    "topic",
    [
        *("/leader/joint_states", "/teleop/joint_states", "/ik_solution", "/joint_states_filtered"),
        *("/smoothed/joint_states", "/joint_states_raw", "/planner/joint_states", "/estimatedJointStates"),
    ],
)
def test_what_is_no_measurement_is_never_taken_for_one(tmp_path, topic):
    path = with_topic(tmp_path / "bag", topic, often=np.arange(2000) / 500.0)
    run = load_run(path, parse_rig(TORQUE_DRIVE))
    assert_allclose(run.columns["knee/position"], MEASURED, rtol=0, atol=1e-9)
    (hint,) = [hint for hint in run.hints if topic in hint]
    assert "/joint_states is used for the measurements" in hint
    entry = f"{topic.strip('/')}/<joint>/position"
    assert f"`columns: {{position: {entry}}}`" in hint
    other = TORQUE_DRIVE["columns"] | {"position": entry}
    run = load_run(path, parse_rig(TORQUE_DRIVE | {"columns": other}))
    assert_allclose(run.columns["knee/position"].mean(), 1.0 + MEASURED.mean(), rtol=0, atol=5e-3)


@pytest.mark.parametrize(
    "topic", ["/goal_position", "/reference", "/knee_target", "/joint_commands", "/desired_joints"]
)
def test_goals_are_commands(tmp_path, topic):
    found = inspect_log(with_topic(tmp_path / "bag", topic))
    assert trial(found) == "" and found.rig["drive"] == "position_servo"
    run = load_run(found.path, parse_rig(dict(found.rig)))
    assert_allclose(run.columns["knee/position"], MEASURED, rtol=0, atol=1e-9)
    assert_allclose(run.columns["knee/position_command"], 1.0 + MEASURED, rtol=0, atol=1e-9)
    assert f"The joints' measurements come from /joint_states, and their commands from {topic}." in run.hints


def test_a_follower_is_measured_and_its_leader_is_not(tmp_path):
    for number, (leader, follower) in enumerate(
        (("/leader/joint_states", "/follower/joint_states"), ("/master_left/joints", "/puppet_left/joints"))
    ):
        path = with_topic(tmp_path / f"bag{number}", leader, state=follower)
        assert_allclose(load_run(path, parse_rig(TORQUE_DRIVE)).columns["knee/position"], MEASURED, rtol=0, atol=1e-9)


def test_two_topics_that_may_both_be_measured_are_refused_with_what_to_write(tmp_path):
    path = with_topic(tmp_path / "bag", "/encoder_feedback", state="/robot_state")
    with pytest.raises(LogError) as refused:
        load_run(path, parse_rig(TORQUE_DRIVE))
    text = str(refused.value)
    assert "'knee/effort' may come from the topics /robot_state, /encoder_feedback; expected one" in text
    assert "columns: {knee/torque_command: robot_state/knee/effort}" in text
    found = inspect_log(path)
    assert found.rig == {} and any("/robot_state and /encoder_feedback have the same joints" in n for n in found.notes)
    columns = {"position": "robot_state/<joint>/position", "torque_command": "robot_state/<joint>/effort"}
    run = load_run(path, parse_rig(TORQUE_DRIVE | {"columns": columns}))
    assert_allclose(run.columns["knee/position"], MEASURED, rtol=0, atol=1e-9)


def test_a_filtered_topic_alone_is_refused_until_the_rig_names_it(tmp_path):
    path = bag(tmp_path / "bag", joint_states("/joint_states_filtered", TIME, {"knee": (MEASURED, VELOCITY, EFFORT)}))
    with pytest.raises(LogError, match=r"only the topic /joint_states_filtered has 'knee/effort'.* write columns: {"):
        load_run(path, parse_rig(TORQUE_DRIVE))
    columns = {
        "position": "joint_states_filtered/<joint>/position",
        "torque_command": "joint_states_filtered/<joint>/effort",
    }
    run = load_run(path, parse_rig(TORQUE_DRIVE | {"columns": columns}))
    assert_allclose(run.columns["knee/position"], MEASURED, rtol=0, atol=1e-9)


@pytest.mark.parametrize("topics", [("/arm1/joint_states", "/arm2/joint_states"), ("/joint_states", "/joint_states")])
def test_rows_of_other_joints_add_no_samples(tmp_path, topics):
    """Whether they are on a topic of their own, or two publishers share one."""
    often = np.arange(1600) / 400.0 + 1e-4
    path = bag(
        tmp_path / "bag",
        joint_states(topics[0], TIME, {"knee": (MEASURED, VELOCITY, EFFORT)}),
        joint_states(topics[1], often, {"hip": (np.cos(often), -np.sin(often), np.sin(often))}),
    )
    for joint, rows in (("knee", TIME.size), ("hip", often.size)):
        rig = TORQUE_DRIVE | {"joint": joint, "columns": {f"{joint}/torque_command": f"{joint}/effort"}}
        run = load_run(path, parse_rig(rig))
        assert len(run) == rows and not any("interpolated" in note and f"Column {joint}" in note for note in run.notes)
    run = load_run(path, parse_rig(TORQUE_DRIVE))
    assert_allclose(run.columns["knee/position"], MEASURED, rtol=0, atol=1e-9)
    assert len(read_table(path)) >= often.size


def test_goals_on_the_topic_of_the_measurements_are_not_taken_for_some(tmp_path):
    """Two nodes use one topic; the goals are positions alone, between the messages of the driver."""
    goal = np.sin(3.0 * (TIME + 0.05))
    states = (MEASURED, VELOCITY, EFFORT)
    path = bag(
        tmp_path / "bag",
        joint_states("/joint_states", TIME, {"knee": states}),
        joint_states("/joint_states", TIME + 0.002, {"knee": (goal,)}),
    )
    run = load_run(path, parse_rig(TORQUE_DRIVE))
    assert_allclose(run.columns["knee/position"], MEASURED, rtol=0, atol=1e-9)
    assert "Two nodes send joint states of the same joints on /joint_states." in run.hints
    entry = {"position": "joint_states#2/<joint>/position"}
    run = load_run(path, parse_rig(TORQUE_DRIVE | {"columns": TORQUE_DRIVE["columns"] | entry}))
    assert_allclose(run.columns["knee/position"], goal, rtol=0, atol=1e-9)  # the rows are those of the goals then


def test_two_senders_of_the_same_quantities_are_told_apart_and_none_is_taken(tmp_path):
    """A copy that is 0.5 rad away alternates with the driver; a few of its messages are lost."""
    kept = np.flatnonzero(np.arange(TIME.size) % 97 != 5)
    other = [values[kept] for values in (MEASURED + 0.5, VELOCITY, EFFORT)]
    path = bag(
        tmp_path / "bag",
        joint_states("/joint_states", TIME, {"knee": (MEASURED, VELOCITY, EFFORT)}),
        joint_states("/joint_states", TIME[kept] + 0.002, {"knee": other}),
    )
    with pytest.raises(LogError, match=r"may come from the topics /joint_states#1, /joint_states#2"):
        load_run(path, parse_rig(TORQUE_DRIVE))
    columns = {"position": "joint_states#1/<joint>/position", "torque_command": "joint_states#1/<joint>/effort"}
    run = load_run(path, parse_rig(TORQUE_DRIVE | {"columns": columns}))
    assert_allclose(run.columns["knee/position"], MEASURED, rtol=0, atol=1e-9)


def test_one_driver_whose_encoder_flickers_is_one_sender(tmp_path):
    """A step forth and back at rest, and parts of a robot in turn, are no second node."""
    flicker = 1e-3 * (np.arange(TIME.size) % 2) + np.where(np.arange(TIME.size) % 100 < 40, 0.0, MEASURED)
    path = bag(
        tmp_path / "bag",
        joint_states("/joint_states", TIME, {"knee": (flicker, VELOCITY, EFFORT)}),
        joint_states("/joint_states", TIME + 0.001, {"hip": (2.0 * MEASURED, VELOCITY, EFFORT)}),
    )
    run = load_run(path, parse_rig(TORQUE_DRIVE))
    assert not any("Two nodes" in hint for hint in run.hints)
    assert len(run) == TIME.size
