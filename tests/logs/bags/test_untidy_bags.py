"""Bags as drivers leave them: orders that change, parts of messages, missing stamps, several robots, single numbers."""

import sqlite3

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rosbags.typesys import get_types_from_msg

from drake_tc.errors import LogError
from drake_tc.logs.files.readers import read_table

from .recorded import STORE, T, arrays, bag, header, joint_states, nanoseconds

TIME = np.arange(400) / 200.0
POSITION, VELOCITY, EFFORT = np.sin(3.0 * TIME), 3.0 * np.cos(3.0 * TIME), 2.0 * np.cos(TIME)


def state(t, names, *parts, stamp=True, topic="/joint_states", late=0.0005):
    values = [np.array(part, dtype=np.float64) for part in (*parts, [], [], [])[:3]]
    message = T["sensor_msgs/msg/JointState"](header(nanoseconds(t) if stamp else None), list(names), *values)
    return topic, "sensor_msgs/msg/JointState", nanoseconds(t + late), message


def notes(table) -> str:
    return " ".join(table.attrs["notes"])


@pytest.mark.parametrize("seed", range(3))
def test_the_order_of_joints_may_change_between_messages(tmp_path, seed):
    rng = np.random.default_rng(seed)
    messages = []
    for i, t in enumerate(TIME):
        order = rng.permutation(2)
        each = [("hip", 0.1, 0.2, 0.3), ("knee", POSITION[i], VELOCITY[i], EFFORT[i])]
        names, q, v, tau = zip(*(each[k] for k in order), strict=True)
        messages.append(state(t, names, q, v, tau))
    table = read_table(bag(tmp_path / "bag", messages))
    assert len(table) == TIME.size and not table.isna().any().any()
    for name, values in (("position", POSITION), ("velocity", VELOCITY), ("effort", EFFORT)):
        assert_allclose(table[f"knee/{name}"], values, rtol=0)
    assert_allclose(table["hip/effort"], 0.3, rtol=0)


def test_messages_that_lack_the_effort_are_rows_without_one(tmp_path):
    lacks = np.arange(TIME.size) % 7 == 3
    messages = [
        state(t, ["knee"], [q], [v], [] if gone else [tau])
        for t, q, v, tau, gone in zip(TIME, POSITION, VELOCITY, EFFORT, lacks, strict=True)
    ]
    table = read_table(bag(tmp_path / "bag", messages))
    assert_allclose(table["knee/position"], POSITION, rtol=0)
    assert_allclose(table["knee/effort"], np.where(lacks, np.nan, EFFORT), rtol=0)


@pytest.mark.parametrize(("without", "rows"), [(60, 340), (300, 400)])
def test_rows_before_a_simulated_clock_began_are_dropped(tmp_path, without, rows):
    """Recording is 30 ms late from the middle on; the stamps, where most rows have one, know nothing of it."""
    messages = [
        state(t, ["knee"], [q], stamp=i >= without, late=0.03 if i >= 200 else 0.0)
        for i, (t, q) in enumerate(zip(TIME, POSITION, strict=True))
    ]
    table = read_table(bag(tmp_path / "bag", messages))
    assert len(table) == rows
    if rows == TIME.size:
        assert "/joint_states has few stamps" in notes(table)
    else:
        assert_allclose(table["time"], TIME[without:] - TIME[without], rtol=0, atol=1e-9)
        assert f"{without} of 400 rows of /joint_states have no stamp and were dropped" in notes(table)


@pytest.mark.parametrize("first", ["/left", ""])
def test_joints_of_two_robots_are_told_apart(tmp_path, first):
    path = bag(
        tmp_path / "bag",
        joint_states(f"{first}/joint_states", TIME, {"knee": (POSITION, VELOCITY)}),
        joint_states("/right/joint_states", TIME, {"knee": (-POSITION, -VELOCITY)}),
        arrays(f"{first}/position_controller/commands", TIME, 1.1 * POSITION[:, None]),
        arrays("/right/position_controller/commands", TIME, -1.2 * POSITION[:, None]),
    )
    table = read_table(path)
    own = f"{first.strip('/')}/knee".strip("/")
    for joint, factor, goal in ((own, 1.0, 1.1), ("right/knee", -1.0, -1.2)):
        assert_allclose(table[f"{joint}/position"], factor * POSITION, rtol=0, atol=1e-12)
        assert_allclose(table[f"{joint}/velocity"], factor * VELOCITY, rtol=0, atol=1e-12)
        assert_allclose(table[f"{joint}/position_command"], goal * POSITION, rtol=0, atol=1e-12)
    assert "Robots with joints of the same names" in notes(table)


def test_torques_on_a_topic_of_their_own_stand_beside_the_drives_efforts(tmp_path):
    """Whichever of the two has more messages, the topic with the positions gives the rows."""
    often = np.arange(1000) / 500.0
    sensed = [state(t, ["knee"], [], [], [5.0 * t], topic="/joint_torques") for t in often]
    path = bag(tmp_path / "bag", joint_states("/joint_states", TIME, {"knee": (POSITION, VELOCITY, EFFORT)}), sensed)
    table = read_table(path)
    assert_allclose(table["knee/effort"], EFFORT, rtol=0, atol=1e-12)
    assert_allclose(table["joint_torques/knee/effort"], 5.0 * TIME, rtol=0, atol=1e-9)
    assert "columns: {knee/torque: joint_torques/knee/effort}" in notes(table)


@pytest.mark.parametrize("kind", ["Float64", "Float32"])
def test_topics_of_one_number_and_temperatures_are_columns(tmp_path, kind):
    messages = [state(t, ["knee"], [q], [v], late=0.0) for t, q, v in zip(TIME, POSITION, VELOCITY, strict=True)]
    number, degrees = T[f"std_msgs/msg/{kind}"], T["sensor_msgs/msg/Temperature"]
    for topic, factor in (("/motor/current", 2.0), ("/knee/velocity", 5.0), ("/knee_controller/command", 7.0)):
        for t in TIME:
            messages.append((topic, number.__msgtype__, nanoseconds(t), number(factor * t)))
    for t in TIME[::50]:
        warm = degrees(header(nanoseconds(t), "motor"), 25.0 + t, 0.0)
        messages.append(("/knee/temperature", degrees.__msgtype__, nanoseconds(t), warm))
    table = read_table(bag(tmp_path / "bag", messages))
    assert_allclose(table["motor/current"], 2.0 * TIME, rtol=1e-6)
    assert_allclose(table["knee_controller/command"], 7.0 * TIME, rtol=1e-6)
    assert_allclose(table["knee/velocity"], VELOCITY, rtol=0)
    assert_allclose(table["/knee/velocity"], 5.0 * TIME, rtol=1e-6)
    known = TIME[::50][-1] >= TIME
    assert_allclose(table["knee/temperature"][known], 25.0 + TIME[known], rtol=1e-12)


@pytest.mark.parametrize("ahead", [0.0003, 0.0])
def test_commands_without_stamps_were_sent_before_they_were_recorded(tmp_path, ahead):
    """The recorder writes both topics 0.8 ms after they were sent: a command is at the row of its cycle."""
    goal = 1.1 * POSITION
    path = bag(
        tmp_path / "bag",
        joint_states("/joint_states", TIME, {"knee": (POSITION, VELOCITY)}, late=0.0008),
        arrays("/position_controller/commands", TIME + 0.0008 - ahead, goal[:, None]),
    )
    table = read_table(path)
    assert_allclose(table["knee/position_command"], goal, rtol=0, atol=1e-12)
    assert "taken 0.8 ms before its recording, as /joint_states is recorded so long after its stamps" in notes(table)


INTERFACES = {
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values",
    "control_msgs/msg/DynamicJointState": (
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values"
    ),
}
"""Messages of ros2_control, of packages that are not part of every distribution."""


def dynamic_states(time, **interfaces):
    """Of one joint `knee`, each interface (T,)."""
    for name, definition in INTERFACES.items():
        if name not in STORE.fielddefs:
            STORE.register(get_types_from_msg(definition, name))
    one, every = (STORE.types[name] for name in INTERFACES)
    for i, t in enumerate(time):
        values = one(list(interfaces), np.array([each[i] for each in interfaces.values()]))
        message = every(header(nanoseconds(t)), ["knee"], [values])
        yield "/dynamic_joint_states", list(INTERFACES)[1], nanoseconds(t), message


def test_interfaces_of_ros2_control_are_columns(tmp_path):
    time = np.arange(300) / 100.0
    path = bag(tmp_path / "bag", dynamic_states(time, position=np.sin(time), current=np.cos(time)))
    table = read_table(path)
    assert_allclose(table["knee/current"], np.cos(time), atol=1e-12)


def test_a_topic_whose_messages_the_bag_does_not_define_is_named_and_the_others_are_read(tmp_path):
    """SQLite bags of older distributions have no definitions."""
    time = np.arange(300) / 100.0
    states = joint_states("/joint_states", time, {"knee": (np.sin(time),)})
    path = bag(tmp_path / "bag", states, dynamic_states(time, position=np.sin(time)), mcap=False)
    (file,) = path.glob("*.db3")
    with sqlite3.connect(file) as database:
        database.execute("delete from message_definitions")
    database.close()
    table = read_table(path)
    assert_allclose(table["knee/position"], np.sin(time), atol=1e-12)
    assert any(hint.startswith("/dynamic_joint_states was not read") for hint in table.attrs["hints"])


OWN = {
    "own_msgs/msg/Motors": "std_msgs/Header header\nstring[] name\nfloat64[] q\nfloat32[] q_des\nfloat64[] tau_meas",
    "own_msgs/msg/Blobs": "std_msgs/Header header\nfloat64[] data",
    "control_msgs/msg/JointTrajectoryControllerState": "std_msgs/Header header\nstring[] joint_names\n"
    + "\n".join(
        f"trajectory_msgs/JointTrajectoryPoint {name}"
        for name in ("desired", "actual", "error", "reference", "feedback")
    ),
}
"""Messages of a driver, and those of a controller in a distribution that has old and new names of the fields."""


def own_type(name):
    if name not in STORE.fielddefs:
        STORE.register(get_types_from_msg(OWN[name], name))
    return STORE.types[name]


def test_vectors_beside_a_list_of_names_are_columns_whatever_the_type(tmp_path):
    motors, time = own_type("own_msgs/msg/Motors"), np.arange(300) / 100.0
    q = np.stack([np.sin(time), np.cos(time)], 1)
    messages = [
        (
            "/motors",
            motors.__msgtype__,
            nanoseconds(t),
            motors(header(nanoseconds(t)), ["hip", "knee"], row, g, 3.0 * row),
        )
        for t, row, g in zip(time, q, (q + 0.5).astype(np.float32), strict=True)
    ]
    table = read_table(bag(tmp_path / "bag", messages))
    assert_allclose(table["knee/position"], np.cos(time), rtol=0, atol=1e-12)
    assert_allclose(table["hip/position_command"], np.sin(time) + 0.5, rtol=0, atol=1e-6)
    assert_allclose(table["hip/torque"], 3.0 * np.sin(time), rtol=0, atol=1e-12)


def test_a_controller_that_fills_the_old_fields_is_read(tmp_path):
    kind, time = own_type("control_msgs/msg/JointTrajectoryControllerState"), np.arange(300) / 100.0
    point, duration = T["trajectory_msgs/msg/JointTrajectoryPoint"], T["builtin_interfaces/msg/Duration"](0, 0)

    def at(*values):
        return point(*(np.array([v] if v is not None else [], dtype=float) for v in (*values, None, None)), duration)

    nothing = at(None, None)
    messages = [
        (
            *("/arm/state", kind.__msgtype__, nanoseconds(t)),
            kind(header(nanoseconds(t)), ["knee"], at(t + 0.1, None), at(t, 1.0), nothing, nothing, nothing),
        )
        for t in time
    ]
    table = read_table(bag(tmp_path / "bag", messages))
    assert_allclose(table["knee/position"], time, rtol=0, atol=1e-12)
    assert_allclose(table["knee/position_command"], time + 0.1, rtol=0, atol=1e-12)
    assert_allclose(table["knee/velocity"], 1.0, rtol=0)


def test_a_bag_of_unknown_types_alone_lists_them(tmp_path):
    blobs = own_type("own_msgs/msg/Blobs")
    message = blobs(header(nanoseconds(0.0)), np.zeros(3))
    path = bag(tmp_path / "bag", [("/blobs", blobs.__msgtype__, nanoseconds(0.0), message)])
    with pytest.raises(LogError, match=r"Topics of other types: /blobs \(own_msgs/msg/Blobs\)"):
        read_table(path)
