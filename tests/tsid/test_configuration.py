"""Controller files: what is committed loads, each key does what it says, and every error names file and field."""

import copy
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal
from optional import skip_without_robots

import drake_tc.models
from drake_tc.control.torque_uncertainty_file import TorqueUncertainty, save_torque_uncertainty
from drake_tc.errors import ParamsError
from drake_tc.robot.plant import file_rotors, joint_limits
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.controller import RobustTsid

MODELS = Path(drake_tc.models.__file__).parent
FILE = MODELS / "hrp2_like" / "hrp2_like_tsid.yaml"
OTHERS = ("talos", "icub", "solo12")


def document(**changes):
    """The committed file, its robot by its full path, with top-level keys replaced (None takes one away)."""
    found = yaml.safe_load(FILE.read_text())
    found["robot"] = str(MODELS / "hrp2_like" / "hrp2_like.yaml")
    found.update(changes)
    return {key: value for key, value in found.items() if value is not None}


@pytest.fixture
def load(tmp_path):
    def write(changes=None, **keys):
        path = tmp_path / "mine.yaml"
        path.write_text(yaml.safe_dump(document(**keys), sort_keys=False))
        return load_law(path, changes)

    return write


def test_the_committed_file_is_what_it_says():
    law = load_law(FILE)
    assert [task.name for task in law.tasks] == ["com", "posture", "force"]
    assert [contact.name for contact in law.model.contacts] == ["right_sole", "left_sole"]
    assert (law.formulation.measure, law.formulation.use, law.formulation.weight) == ("individual", "trade_off", 1e-5)
    assert_allclose(law.error.sigma, 0.003 * joint_limits(law.model.robot).effort, rtol=1e-12)
    assert [limit.group for limit in law.limits] == ["torque", "force", "acceleration"]
    assert len(law.constraints) == 30 + 22 + 30 + 3
    assert len(set(law.constraints)) == len(law.constraints)


@pytest.mark.parametrize("name", OTHERS)
def test_other_robots_files_load(name):
    path = MODELS / name / f"{name}_tsid.yaml"
    skip_without_robots()
    law = load_law(path)
    assert law.model.force_size == 12  # two soles, or four points
    assert {contact.kind for contact in law.model.contacts} == ({"point"} if name == "solo12" else {"surface"})


def test_changes_are_laid_over_and_null_takes_away(load):
    law = load({"tasks": {"com": None, "posture": {"kp": 3.0}}, "formulation": {"measure": "classic"}, "period": 2e-3})
    assert [task.name for task in law.tasks] == ["posture", "force"]
    assert (law.formulation.measure, law.period) == ("classic", 2e-3)
    assert [limit.group for limit in load({"limits": {"torque": None, "capture_point": {}}}).limits] == [
        "force",
        "acceleration",
        "capture_point",
    ]


def test_sigma_is_a_share_a_list_a_mapping_or_a_file(load, tmp_path):
    joints = load().model.robot.joints
    effort = joint_limits(load().model.robot).effort
    assert_allclose(load(sigma=0.01).error.sigma, 0.01 * effort, rtol=1e-12)
    listed = np.linspace(0.1, 3.0, 30)
    assert_allclose(load(sigma=listed.tolist()).error.sigma, listed, rtol=1e-12)
    by_joint = dict(zip(joints, listed.tolist(), strict=True))
    assert_allclose(load(sigma=dict(reversed(by_joint.items()))).error.sigma, listed, rtol=1e-12)
    root = np.random.default_rng(0).normal(size=(30, 30))
    covariance = root @ root.T
    order = np.random.default_rng(1).permutation(30)
    nothing = [np.full(30, np.nan)] * 3
    file = TorqueUncertainty(
        tuple(joints[i] for i in order), covariance, np.zeros(30), np.full((30, 2), np.nan), *nothing[:2], np.ones(30)
    )
    save_torque_uncertainty(file, tmp_path / "torque_uncertainty.yaml")
    back = np.argsort(order)
    assert_allclose(
        load(sigma="torque_uncertainty.yaml").error.covariance, covariance[np.ix_(back, back)], rtol=1e-9, atol=1e-12
    )


def test_limits_are_what_their_keys_say(load):
    law = load(limits={"torque": {"share": 0.5}, "acceleration": {"acceleration": 7.0, "period": 0.01}})
    terms = law.starting_terms()
    torque, _, acceleration = (limit.rows(terms) for limit in law.limits)
    assert_allclose(torque.upper, 0.5 * joint_limits(law.model.robot).effort)
    assert acceleration.upper.max() == 7.0
    cone = {c.name: c for c in law.model.contacts}["left_sole"]
    assert (cone.friction, cone.half_length, cone.frame.link) == (0.3, 0.1, "l_foot")
    sole = law.model.terms(law.model.create_scratch(), law.model.start, np.zeros(36)).pose("left_sole")[1]
    assert_allclose(sole[2], 0.0, atol=2e-5)


def test_rotor_inertias_are_laid_over_the_robots_own(load):
    own, given, none = (load(rotor_inertia=entry).model for entry in (None, {"r_knee": 0.8}, {}))
    q, v = own.start, np.zeros(own.nv)
    masses = [model.terms(model.create_scratch(), q, v).mass_matrix for model in (own, given, none)]
    added = masses[1] - masses[0]
    knee = own.actuated[own.robot.joints.index("r_knee")]
    assert_allclose(added[knee, knee], 0.8 - file_rotors(own.robot)["r_knee"], rtol=1e-9)
    added[knee, knee] = 0.0
    assert_allclose(added, 0.0, atol=1e-12)
    assert_array_equal(masses[2], masses[0])


def test_a_limit_may_look_as_far_ahead_as_a_tick_or_farther(load):
    for period in (1e-3, 0.1 * 0.01, 7e-3):
        load(limits={"acceleration": {"period": period}, "capture_point": {"period": period}})
    with pytest.raises(ParamsError, match=r"limits\.acceleration: period: expected the controller's period, 0\.01 s"):
        load(period=0.01, limits={"acceleration": {"period": 5e-3}})


def test_a_capture_point_without_contacts_is_refused(load):
    posture = {"posture": {"kind": "posture", "kp": 1.0, "kd": 1.0}}
    with pytest.raises(ParamsError, match=r"limits\.capture_point: capture point: expected contacts"):
        load(contacts=None, tasks=posture, limits={"capture_point": {}})


def test_a_minimum_is_read_where_it_acts_and_classic_replaces_a_measure(load):
    law = load(formulation={"use": "constraint", "minimum": 1e-3, "iterations": 2.0})
    assert (law.formulation.minimum, law.formulation.options.budget.iterations) == (1e-3, 2)
    assert load({"formulation": {"measure": "classic"}}).formulation.measure == "classic"


def test_axes_of_a_contact_are_read(load):
    for axes, upright in (({}, True), ({"axes": "world"}, True), ({"axes": "link"}, False)):
        law = load({"contacts": {"hand": {"kind": "point", "link": "l_hand", **axes}}})
        assert [contact.upright for contact in law.model.contacts] == [False, False, upright]


def test_a_sole_becomes_a_point_when_its_keys_are_taken_away(load):
    sole = document()["contacts"]["left_sole"]
    none = {key: None for key in SOLE_ALONE if key in sole}
    assert {"half_length", "half_width"} <= set(none)
    law = load({"contacts": {"left_sole": {"kind": "point", **none}}, "tasks": {"force": None}})
    assert [contact.size for contact in law.model.contacts] == [6, 3]


def test_every_kind_of_task_is_read(load):
    common = {"kp": 10.0, "kd": 2.0}
    law = load(
        tasks={
            "a": {"kind": "com", **common, "mask": [True, True, False], "weight": [1.0, 2.0, 3.0]},
            "b": {"kind": "posture", **common, "joints": ["r_knee", "l_knee"]},
            "c": {"kind": "frame", "frame": "right_palm", **common, "axes_of": "frame"},
            "d": {"kind": "orientation", "frame": "torso", **common},
            "e": {"kind": "angular_momentum", "kp": 1.0},
            "f": {"kind": "force", "components": [1.0] * 6},
            "g": {"kind": "cop", "contact": "left_sole"},
        }
    )
    assert [task.name for task in law.tasks] == list("abcdefg")
    assert_array_equal(law.tasks[0].weight, [1.0, 2.0])
    terms = law.starting_terms()
    rows = [task.rows(terms, task.rest(terms)).target.size for task in law.tasks]
    assert rows == [2, 2, 6, 3, 3, 12, 2]


def changed(path, value):
    """The document with one value changed, down its keys."""
    found = copy.deepcopy(document())
    part = found
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    return found


SOLE_ALONE = {"half_length": 0.1, "half_width": 0.1, "extents": [-0.1, 0.1, -0.1, 0.1], "moment_friction": 0.2}
REFUSED = [
    (("robot",), "nowhere.yaml", "nowhere.yaml: no such file"),
    (("colour",), "red", "unknown key 'colour'; allowed: robot, tasks"),
    (("tasks",), {}, "tasks: expected at least 1 entry, got {}"),
    (("tasks", "com"), {"kp": 1.0}, "tasks.com: missing key 'kind'"),
    (("tasks", "com", "kind"), "mass", "tasks.com.kind: expected one of com, posture, frame"),
    (("tasks", "com", "kp"), -1.0, r"tasks.com: .*kp: expected finite numbers >= 0"),
    (("tasks", "com", "kp"), [1.0, 2.0], r"tasks.com: .*kp: expected a number or 3 of them"),
    (("tasks", "com", "mask"), [1, 0, 1], "tasks.com.mask: expected a list of true and false"),
    (("tasks", "com", "kq"), 1.0, "tasks.com: unknown key 'kq'"),
    (("tasks", "hand"), {"kind": "frame", "frame": "hand", "kp": 1.0, "kd": 1.0}, "tasks.hand: .*no frame 'hand'"),
    (("tasks", "posture", "joints"), ["elbow"], "tasks.posture: .*no joint 'elbow'"),
    (("tasks", "force", "components"), 1.0, "tasks.force.components: expected a list of numbers"),
    (("contacts", "left_sole", "link"), "paw", "contact 'left_sole': no link 'paw'"),
    (("contacts", "left_sole", "half_length"), 0.0, "contact 'left_sole': expected a sole of positive size"),
    (("contacts", "left_sole", "friction"), -0.1, "contact 'left_sole': friction: expected a finite number >= 0"),
    (("contacts", "left_sole", "axes"), "world", "contact 'left_sole': axes: expected link for a surface, got 'world'"),
    (("contacts", "left_sole", "axes"), 3, "contacts.left_sole.axes: expected one of link, world, got 3"),
    (("contacts", "left_sole", "colour"), "red", "contacts.left_sole: unknown key 'colour'"),
    (("contacts", "left_sole", "extents"), [0.0, 1.0], "contacts.left_sole.extents: expected a list of 4 numbers"),
    (("frames", "right_palm", "link"), "paw", "frame 'right_palm': no link 'paw'"),
    (("limits", "acceleration", "velocity"), [1.0], "limits.acceleration: velocity: expected a number or 30 of them"),
    (("limits", "acceleration", "acceleration"), 0.0, "limits.acceleration: acceleration of .*expected a positive"),
    (("limits", "torque"), {"share": -1.0}, "limits.torque: .*expected a positive share"),
    (("limits", "contact"), {"pyramid": "round"}, "limits.contact: pyramid: expected one of inner, outer"),
    (("limits", "speed"), {}, "limits: unknown key 'speed'; possible: acceleration, capture_point, contact, torque"),
    (("formulation", "measure"), "best", "formulation.measure: expected one of classic, individual"),
    (("formulation", "use"), "always", "formulation.use: expected one of trade_off"),
    (("formulation", "weight"), 0.0, "formulation.weight: expected a positive number"),
    (("sigma",), [1.0, 2.0], "sigma: expected 30 numbers, one for each joint, got 2"),
    (("sigma",), -0.1, "sigma: expected finite numbers >= 0"),
    (("sigma",), {"r_knee": 1.0}, "sigma: r_hip_yaw is missing; expected a number"),
    (("sigma",), "lost.yaml", "lost.yaml: no such file"),
    (("solver",), "simplex", "solver: expected one of daqp, quadprog"),
    (("period",), 0.0, "period: expected a positive number"),
    (("period",), "soon", "period: expected a finite number, got 'soon'"),
    (("contact_damping",), -1.0, "contact_damping: expected a finite number >= 0"),
    (("rotor_inertia",), {"r_knee": -1.0}, "rotor_inertia.r_knee: expected a number >= 0, got -1.0"),
    (("limits", "acceleration", "period"), 9e-4, "limits.acceleration: period: expected the controller's period"),
    (("limits", "acceleration", "margin"), -1.0, "limits.acceleration: margin: expected a finite number >= 0"),
    (("limits", "capture_point"), {"period": 1e-4}, "limits.capture_point: period: expected the controller's period"),
    (("limits", "capture_point"), {"margin": -0.01}, "limits.capture_point: capture point: margin: expected a finite"),
    (("limits", "torque"), {"share": 7.0}, "limits.torque: .*expected a positive share, 1 at most, got 7"),
    (
        ("formulation",),
        {"measure": "classic", "use": "constraint"},
        "formulation.use: expected a measure of robustness",
    ),
    (
        ("formulation",),
        {"measure": "classic", "use": "null_space"},
        "formulation.use: expected a measure of robustness",
    ),
    (("formulation",), {"measure": "classic", "minimum": 0.1}, "formulation.minimum: it belongs to `use: constraint`"),
    (("formulation",), {"minimum": 0.1}, "formulation.minimum: it belongs to `use: constraint`, got use: trade_off"),
    (("formulation",), {"use": "null_space", "minimum": 0.1}, "formulation.minimum: it belongs to `use: constraint`"),
    (("formulation", "iterations"), 0.6, "formulation.iterations: expected a whole number >= 1, got 0.6"),
    (("formulation", "iterations"), 2.4, "formulation.iterations: expected a whole number >= 1, got 2.4"),
    (("formulation", "iterations"), 0, "formulation.iterations: expected a whole number >= 1, got 0"),
    *(
        (
            ("contacts", "tip"),
            {"kind": "point", "link": "l_hand", key: value},
            f"contacts.tip.{key}: it belongs to `kind: surface`",
        )
        for key, value in SOLE_ALONE.items()
    ),
]


@pytest.mark.parametrize(
    ("path", "value", "message"), REFUSED, ids=[".".join(row[0]) + f"={row[1]}" for row in REFUSED]
)
def test_what_cannot_be_is_refused_with_file_and_field(tmp_path, path, value, message):
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(changed(path, value), sort_keys=False))
    with pytest.raises(ParamsError, match=rf"^{file}: .*{message}") as error:
        load_law(file)
    assert "\n" not in str(error.value)


def test_a_robot_without_feet_where_contacts_are_wanted(load):
    with pytest.raises(ParamsError, match=r"tasks.force: .*expected a model with contacts; robot 'hrp2_like' has none"):
        load(contacts=None)
    law = load(contacts=None, tasks={"posture": {"kind": "posture", "kp": 1.0, "kd": 1.0}})
    assert law.model.force_size == 0
    assert [limit.group for limit in law.limits] == ["torque", "acceleration"]


def test_tasks_whose_ports_would_be_called_the_same_are_refused(load):
    com = {"kind": "com", "kp": 1.0, "kd": 1.0}
    with pytest.raises(ParamsError, match="expected different names; 'a_b' is the same as 'a b' in a name of a port"):
        load({"tasks": {"a b": com, "a_b": com}})
    law = load({"tasks": {"a b": com, "ab": com}})
    ports = {RobustTsid(law).get_input_port(i).get_name() for i in range(RobustTsid(law).num_input_ports())}
    assert {"a_b_reference", "ab_reference"} <= ports


def test_a_key_given_twice_and_a_file_that_is_none(tmp_path):
    file = tmp_path / "twice.yaml"
    file.write_text(FILE.read_text() + "period: 0.002\n")
    with pytest.raises(ParamsError, match=r"twice.yaml: line \d+: key 'period' is given twice"):
        load_law(file)
    with pytest.raises(ParamsError, match=r"nowhere.yaml: no such controller file"):
        load_law(tmp_path / "nowhere.yaml")


def test_the_readme_has_every_key_of_tasks_and_limits():
    import drake_tc.tsid.configuration as configuration
    from drake_tc.tsid.kinds import OWN_LIMITS as LIMITS
    from drake_tc.tsid.kinds import OWN_TASKS as TASKS

    page = (Path(configuration.__file__).parent / "README.md").read_text("utf-8")
    keys = {*LIMITS, *TASKS}
    keys |= {key for kind in (*TASKS.values(), *LIMITS.values()) for key in (*kind.required, *kind.optional)}
    assert {key for key in keys if f"`{key}`" not in page and f"`{key}:" not in page} == set()
