"""Files of other simulators are read as these simulators read them."""

import json

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.errors import RigError
from drake_tc.simulator_files.read import ANY_JOINT, read_joints

MJCF = """<mujoco>
  <compiler angle="radian"/>
  <default>
    <joint damping="2" frictionloss="0.5"/>
    <default class="leg">
      <joint armature="0.1"/>
      <position kp="300" kv="4" forcerange="-50 50"/>
      <default class="foot"> <joint damping="0.3 0.2" armature="0.02"/> </default>
    </default>
  </default>
  <worldbody>
    <body name="thigh" childclass="leg">
      <geom size="0.1" mass="1"/>
      <joint name="hip" axis="0 1 0"/>
      <body name="shank">
        <geom size="0.1" mass="1"/>
        <joint name="knee" axis="0 1 0" frictionloss="1.5"/>
        <body name="sole">
          <geom size="0.1" mass="1"/>
          <joint name="ankle" axis="0 1 0" class="foot"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="h" joint="hip" class="leg"/>
    <motor name="k" joint="knee" gear="80" forcerange="-2 2"/>
    <general name="a" joint="ankle" gainprm="120" biastype="affine" biasprm="0 -120 -3" gear="2"/>
  </actuator>
</mujoco>
"""


@pytest.fixture
def mjcf(tmp_path):
    path = tmp_path / "leg.xml"
    path.write_text(MJCF, encoding="utf-8")
    return path


def test_defaults_of_classes_are_those_that_mujoco_sees(mjcf):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(mjcf))
    for name, joint in read_joints(mjcf, RigError).items():
        dof = model.joint(name).dofadr[0]
        assert joint.terms.armature == model.dof_armature[dof]
        assert joint.terms.frictionloss == model.dof_frictionloss[dof]
        damping = np.ravel(model.dof_damping[dof])
        assert joint.terms.damping == damping[0]


def test_actuators_push_as_hard_as_in_mujoco(mjcf):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(mjcf))
    data = mujoco.MjData(model)
    joints = read_joints(mjcf, RigError)
    data.ctrl[:] = [0.01, 0.5, 0.0]  # hip: position error; knee: motor
    data.qpos[2] = -0.01  # the ankle's servo holds 0, behind a gear of 2
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(
        data.qfrc_actuator,
        [joints["hip"].terms.kp * 0.01, joints["knee"].terms.kp * 0.5, joints["ankle"].terms.kp * 0.01],
        rtol=1e-9,
    )
    data.qpos[2], data.qvel[0], data.qvel[2] = 0.0, 0.1, 0.1
    data.ctrl[:] = 0.0
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_actuator[0], -0.1 * joints["hip"].derivative_gain, rtol=1e-9)
    np.testing.assert_allclose(data.qfrc_actuator[2], -0.1 * joints["ankle"].derivative_gain, rtol=1e-9)


@pytest.mark.parametrize(
    "attributes",
    [
        'motorconst="0.5" resistance="2" gear="3"',
        'motorconst="0.5 0.4" resistance="2" ctrlrange="-5 5"',
        'motorconst="0.5" resistance="2" saturation="0.8 0 0"',
        'motorconst="0.5" resistance="2" gear="2" saturation="0 1 0"',
    ],
)
def test_a_dc_motor_pushes_as_hard_as_in_mujoco(tmp_path, attributes):
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "motor.xml"
    body = '<body><joint name="a" damping="0.1"/><geom size="0.1" mass="1"/></body>'
    motor = f'<actuator><dcmotor name="m" joint="a" {attributes}/></actuator>'
    path.write_text(f"<mujoco><worldbody>{body}</worldbody>{motor}</mujoco>", encoding="utf-8")
    (joint,) = read_joints(path, RigError).values()
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)

    def torque(voltage, velocity):
        data.ctrl[0], data.qvel[0] = voltage, velocity
        mujoco.mj_forward(model, data)
        return data.qfrc_actuator[0] + data.qfrc_passive[0]

    assert joint.terms.drive == "voltage" and joint.unused == ()
    assert torque(1.0, 0.3) == pytest.approx(joint.terms.kp - 0.3 * joint.terms.damping, rel=1e-9)
    limit = joint.terms.torque_limit
    assert torque(1e3, 0.0) == pytest.approx(1e3 * joint.terms.kp if limit is None else limit, rel=1e-9)


def test_a_dc_motor_that_is_more_than_these_terms_says_so(tmp_path):
    path = tmp_path / "motor.xml"
    body = '<body><joint name="a"/></body>'
    text = f'<mujoco><worldbody>{body}</worldbody><actuator><dcmotor joint="a" {{}}/></actuator></mujoco>'
    path.write_text(text.format('motorconst="0.5" resistance="2" cogging="0.1 4 0"'), encoding="utf-8")
    joint = read_joints(path, RigError)["a"]
    assert joint.terms.ripple is not None and joint.unused == ()
    path.write_text(text.format('nominal="12 1 300"'), encoding="utf-8")
    assert read_joints(path, RigError)["a"].unused == (
        "nominal of <dcmotor> in line 1",
        "its actuator <dcmotor> in line 1",
    )


def test_limits_and_kinds_of_drives(mjcf):
    joints = read_joints(mjcf, RigError)
    assert [joints[name].terms.drive for name in ("hip", "knee", "ankle")] == [
        "position_servo",
        "torque",
        "position_servo",
    ]
    assert joints["hip"].terms.torque_limit == 50.0 and joints["knee"].terms.torque_limit == 160.0
    assert joints["ankle"].terms.quadratic == 0.2 and joints["ankle"].terms.torque_limit is None


URDF = """<robot name="r" xmlns:drake="http://drake.mit.edu">
  <link name="base"/>
  <link name="shank">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="knee" type="revolute">
    <parent link="base"/><child link="shank"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="60" velocity="5"/>
    <dynamics damping="1.5" friction="0.7"/>
  </joint>
  <transmission name="t">
    <type>transmission_interface/SimpleTransmission</type>
    <joint name="knee"/>
    <actuator name="m">
      <drake:rotor_inertia value="2e-5"/><drake:gear_ratio value="100"/><drake:controller_gains p="400" d="3"/>
    </actuator>
  </transmission>
</robot>
"""


DECLARED = ' xmlns:drake="http://drake.mit.edu"'
HINT = '<gazebo:hint a="1"/></{root}>'


@pytest.mark.parametrize(
    ("declared", "prefix", "read"),
    [
        ("", "drake", True),
        (' xmlns:drake="http://example.org"', "drake", True),
        ("", "mine", False),
        (' xmlns:mine="http://drake.mit.edu"', "mine", False),
    ],
)
@pytest.mark.parametrize("kind", ["urdf", "sdf"])
def test_drakes_tags_are_those_with_its_prefix_as_for_drake(tmp_path, kind, declared, prefix, read):
    """Drake's parsers read the prefix as it is written, also where it is not declared."""
    text, root = (URDF, "robot") if kind == "urdf" else (SDF, "sdf")
    text = text.replace(DECLARED, declared).replace("<drake:", f"<{prefix}:").replace("</drake:", f"</{prefix}:")
    path = tmp_path / f"robot.{kind}"
    path.write_text(text, encoding="utf-8")
    plant = MultibodyPlant(1e-3)
    Parser(plant).AddModels(str(path))
    plant.Finalize()
    actuator = plant.get_joint_actuator(plant.GetJointActuatorIndices()[0])
    reflected = actuator.default_rotor_inertia() * actuator.default_gear_ratio() ** 2
    joint = read_joints(path, RigError)["knee"]
    np.testing.assert_allclose(joint.terms.armature, reflected if read else 0.0, rtol=1e-12)
    assert (reflected > 0.0, actuator.has_controller(), joint.driven) == (read, read, read)
    path.write_text(text.replace(f"</{root}>", HINT.format(root=root)), encoding="utf-8")
    assert read_joints(path, RigError)["knee"] == joint  # Drake reads a URDF with such a tag, and warns of an SDF


def test_what_is_no_xml_is_refused_in_words(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text("<robot><a></robot>", encoding="utf-8")
    with pytest.raises(RigError, match=r"robot\.urdf: expected URDF, .* not XML: mismatched tag: line 1, column 12"):
        read_joints(path, RigError)


SDF = """<sdf version="1.9" xmlns:drake="http://drake.mit.edu">
  <model name="r">
    <link name="base"/>
    <link name="shank"/>
    <link name="foot"/>
    <joint name="glue" type="fixed"><parent>shank</parent><child>foot</child></joint>
    <joint name="knee" type="revolute">
      <parent>base</parent><child>shank</child>
      <axis>
        <xyz>0 1 0</xyz>
        <limit><lower>-1</lower><upper>1</upper><effort>60</effort></limit>
        <dynamics><damping>1.5</damping><friction>0.7</friction><spring_stiffness>5</spring_stiffness></dynamics>
      </axis>
      <drake:rotor_inertia>2e-5</drake:rotor_inertia><drake:gear_ratio>100</drake:gear_ratio>
      <drake:controller_gains p="400" d="3"/>
    </joint>
  </model>
</sdf>
"""


ENDS = "its limits of the position (lower, upper)"


@pytest.mark.parametrize(
    ("kind", "text", "unused"), [("urdf", URDF, ("its limit of the velocity", ENDS)), ("sdf", SDF, (ENDS,))]
)
def test_a_file_with_drakes_tags_is_read_as_drake_reads_it(tmp_path, kind, text, unused):
    path = tmp_path / f"robot.{kind}"
    path.write_text(text, encoding="utf-8")
    (joint,) = read_joints(path, RigError).values()
    plant = MultibodyPlant(1e-3)
    Parser(plant).AddModels(str(path))
    plant.Finalize()
    actuator = plant.get_joint_actuator(plant.GetJointActuatorIndices()[0])
    reflected = actuator.default_rotor_inertia() * actuator.default_gear_ratio() ** 2
    np.testing.assert_allclose(joint.terms.armature, reflected, rtol=1e-12)
    assert joint.terms.damping == plant.GetJointByName("knee").default_damping_vector()[0] == 1.5
    assert joint.terms.frictionloss == 0.7 and joint.terms.torque_limit == actuator.effort_limit() == 60.0
    gains = actuator.get_controller_gains()
    assert (joint.terms.kp, joint.derivative_gain) == (gains.p, gains.d) == (400.0, 3.0)
    assert joint.unused == unused
    assert joint.terms.stiffness == (5.0 if kind == "sdf" else 0.0)


def test_a_limit_that_an_sdf_file_does_not_have_is_none(tmp_path):
    path = tmp_path / "robot.sdf"
    for effort in ("-1", "inf", "0"):
        path.write_text(SDF.replace("<effort>60<", f"<effort>{effort}<"), encoding="utf-8")
        assert read_joints(path, RigError)["knee"].terms.torque_limit is None


BAM = {
    "model": "m4",
    "kt": 2.0,
    "R": 4.0,
    "armature": 0.012,
    "friction_base": 0.05,
    "friction_viscous": 0.1,
    "friction_stribeck": 0.03,
    "dtheta_stribeck": 0.4,
    "alpha": 1.2,
    "load_friction_base": 0.2,
    "load_friction_stribeck": 0.1,
    "command_delay": 0.01,
    "q_offset": 0.01,
}


def test_a_bam_file_is_a_servo_on_a_voltage(tmp_path):
    path = tmp_path / "servo.json"
    path.write_text(json.dumps(BAM), encoding="utf-8")
    joint = read_joints(path, RigError)[ANY_JOINT]
    assert joint.terms.drive == "voltage" and joint.terms.kp == 0.5
    assert joint.terms.damping == pytest.approx(0.1 + 2.0**2 / 4.0)  # the back-EMF brakes too
    assert joint.effects["stribeck"] == {"stribeck": 0.03, "stribeck_velocity": 0.4, "stribeck_exponent": 1.2}
    assert joint.effects["load_dependent_friction"] is None and joint.unused == ("q_offset",)
    assert joint.terms.delay == 0.01


@pytest.mark.parametrize(
    ("change", "effects"),
    [
        ({"model": "m1"}, {}),
        ({"model": "m3"}, {"load_dependent_friction": None}),
        ({"model": "m2", "alpha": 6.0}, {"stribeck": None}),
    ],
)
def test_a_bam_file_declares_what_its_model_has(tmp_path, change, effects):
    path = tmp_path / "servo.json"
    path.write_text(json.dumps(BAM | change), encoding="utf-8")
    assert read_joints(path, RigError)[ANY_JOINT].effects == effects


def test_parameters_that_the_model_of_a_bam_file_does_not_use_are_listed(tmp_path):
    path = tmp_path / "servo.json"
    path.write_text(json.dumps(BAM | {"model": "m1"}), encoding="utf-8")
    peak, load = ("alpha", "dtheta_stribeck", "friction_stribeck"), ("load_friction_base", "load_friction_stribeck")
    assert set(read_joints(path, RigError)[ANY_JOINT].unused) == {*peak, *load, "q_offset"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"model": "m7"}, "model: expected one of m1, m2, m3, m4, m5, m6, got 'm7'"),
        ({"model": None}, "model: expected one of"),
        ({"armature": -0.1}, "armature: expected a number of 0 or more, got -0.1"),
        ({"friction_base": float("nan")}, "friction_base: expected a number of 0 or more, got nan"),
        ({"dtheta_stribeck": 0.0}, "dtheta_stribeck, alpha: expected positive numbers, got 0 and 1.2"),
    ],
)
def test_odd_numbers_of_a_bam_file_are_refused(tmp_path, change, message):
    path = tmp_path / "servo.json"
    path.write_text(json.dumps(BAM | change), encoding="utf-8")
    with pytest.raises(RigError, match=message):
        read_joints(path, RigError)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("robot.xml", "<mujoco", "not XML"),
        ("robot.xml", "<usd/>", r"expected a URDF \(<robot>\), an SDFormat file \(<sdf>\) or an MJCF"),
        ("robot.sdf", "<sdf/>", "no joint that moves"),
        ("robot.xml", "<mujoco/>", "no joint that moves"),
        ("robot.xml", "<mujoco><worldbody><body><joint name='a' armature='x'/></body></worldbody></mujoco>", "'x'"),
        ("servo.json", "[1]", "expected a parameter file of BAM"),
        ("servo.json", "{", "servo.json: "),
        ("servo.json", '{"kt": 1.0}', "R: expected a number"),
        ("servo.json", '{"kt": 1.0, "R": 0}', "expected positive numbers"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused(tmp_path, name, text, message):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RigError, match=message) as refused:
        read_joints(path, RigError)
    assert str(path) in str(refused.value) and "\n" not in str(refused.value)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(RigError, match=r"none\.xml: no such file; expected a URDF"):
        read_joints(tmp_path / "none.xml", RigError)


INCLUDED = """<sdf version="1.9"><world name="w">
  <include><uri>model://sun</uri></include>
  <include><uri>{uri}</uri></include>
</world></sdf>"""
ARM = """<sdf version="1.9"><model name="arm"><link name="l"/><joint name="elbow" type="revolute"><parent>world</parent>
<child>l</child><axis><xyz>0 0 1</xyz><dynamics><damping>0.3</damping><friction>0.2</friction></dynamics></axis></joint>
</model></sdf>"""


@pytest.mark.parametrize(
    ("uri", "file"), [("arm.sdf", "arm.sdf"), ("model://arm", "arm/model.sdf"), ("arm", "arm/arm.sdf")]
)
def test_joints_of_included_models_are_read(tmp_path, uri, file):
    world, model = tmp_path / "world.sdf", tmp_path / file
    model.parent.mkdir(exist_ok=True)
    model.write_text(ARM, encoding="utf-8")
    world.write_text(INCLUDED.format(uri=uri), encoding="utf-8")
    joint = read_joints(world, RigError)["elbow"]
    assert (joint.terms.damping, joint.terms.frictionloss) == (0.3, 0.2)
    assert joint.unused == ("<include> in line 2: 'model://sun': no such file or model",)


def test_an_include_that_cannot_be_followed_is_refused_with_its_line(tmp_path):
    world = tmp_path / "world.sdf"
    for uri, text, message in (
        ("gone.sdf", "", r"<include> in line 2: 'model://sun': no such file or model"),
        ("world.sdf", "", r"<include> in line 3: .*world.sdf includes itself"),
        ("arm.sdf", ARM.replace("0.3<", "soft<"), r"arm.sdf: <damping> in line 2: damping: expected finite numbers"),
        ("arm.sdf", "<sdf", "<include> in line 3: .*arm.sdf: .*not XML"),
        ("arm.sdf", "<mujoco/>", "<include> in line 3: .*arm.sdf: expected <sdf> or <robot>, got <mujoco>"),
        ("arm.sdf</uri></include><include><uri>arm.sdf", ARM, "<include> in line 3: joint 'elbow' is there twice"),
    ):
        (tmp_path / "arm.sdf").write_text(text or ARM, encoding="utf-8")
        world.write_text(INCLUDED.format(uri=uri), encoding="utf-8")
        with pytest.raises(RigError, match=message):
            read_joints(world, RigError)


def test_what_couples_joints_of_a_urdf_is_listed(tmp_path):
    path = tmp_path / "robot.urdf"
    bushing = '<drake:linear_bushing_rpy xmlns:drake="http://drake.mit.edu"/>'
    path.write_text(URDF.replace("</robot>", f"\n{bushing}</robot>"), encoding="utf-8")
    assert any("<drake:linear_bushing_rpy> in line" in each for each in read_joints(path, RigError)["knee"].unused)


TRANSMISSION = (
    '<transmission name="t{}"><type>SimpleTransmission</type><joint name="a"/><actuator name="m">'
    "<mechanicalReduction>50</mechanicalReduction><motorInertia>1e-5</motorInertia></actuator>{}</transmission>"
)
MOTOR, DRAKES = "<motorInertia>1e-5</motorInertia>", '<drake:rotor_inertia value="0.025"/>'
DIFFERENTIAL = '<transmission name="w" type="WristTransmission"><flexJoint name="a"/></transmission>'
LIMITED = (
    '<ros2_control name="c"><joint name="a"><command_interface name="effort"><param name="max">3</param>'
    "</command_interface></joint></ros2_control>"
)
IN_CONTROL = '<ros2_control name="c"><transmission name="t"><joint name="a"/></transmission></ros2_control>'


@pytest.mark.parametrize(
    ("of_joint", "beside", "told"),
    [
        ('<dynamics damping="0.3"/><dynamics friction="0.2"/>', "", "its further <dynamics>"),
        (
            "",
            TRANSMISSION.format(1, "") + TRANSMISSION.format(2, ""),
            "its further transmission <transmission name='t2'>",
        ),
        ("", TRANSMISSION.format(1, "<motorTorqueConstant>1</motorTorqueConstant>"), "its motorTorqueConstant"),
        ("", IN_CONTROL, "its <ros2_control> transmission"),
        ('<safety_controller k_velocity="3"/>', "", "its safety_controller"),
        ("<dynamics><damping>0.3</damping></dynamics>", "", "damping of its dynamics"),
        (
            "",
            TRANSMISSION.format(1, "").replace('"a"/>', '"a"><mechanicalReduction>2</mechanicalReduction></joint>'),
            "its further mechanicalReduction (2)",
        ),
        ("", '<gazebo><plugin name="pid"><joint>a</joint><p>30</p></plugin></gazebo>', "its <plugin name='pid'>"),
        ("", '<gazebo><plugin name="f"><mimicJoint>a</mimicJoint></plugin></gazebo>', "its <plugin name='f'>"),
        ("", '<gazebo><joint name="loop"><parent>l</parent><child>b</child></joint></gazebo>', "<joint name='loop'>"),
        ("", LIMITED, "its <ros2_control> parameter max"),
        ("", DIFFERENTIAL, "its transmission <transmission name='w'> in line 1, which is no SimpleTransmission"),
        ("", TRANSMISSION.format(1, "").replace(MOTOR, ""), "its mechanicalReduction (50)"),
        ("", TRANSMISSION.format(1, "").replace(MOTOR, DRAKES), "its mechanicalReduction (50)"),
        ("", '<joint name="f" type="continuous"><mimic joint="a"/></joint>', "that 'f' follows it (mimic)"),
    ],
)
def test_odd_forms_of_a_urdf_are_listed(tmp_path, of_joint, beside, told):
    path = tmp_path / "robot.urdf"
    path.write_text(
        '<robot name="r"><link name="b"/><link name="l"/><joint name="a" type="continuous"><parent link="b"/>'
        f'<child link="l"/>{of_joint}</joint>{beside}</robot>'
    )
    joint = read_joints(path, RigError)["a"]
    assert any(told in each for each in joint.unused)
    assert joint.terms.armature == pytest.approx(0.025 if "Inertia" in beside or "inertia" in beside else 0.0)


def test_a_limit_of_a_urdf_may_be_infinite(tmp_path):
    path = tmp_path / "robot.urdf"
    limit = '<limit effort="inf" velocity="inf" lower="-inf" upper="inf"/>'
    path.write_text(f'<robot name="r"><joint name="a" type="revolute">{limit}</joint></robot>')
    joint = read_joints(path, RigError)["a"]
    assert joint.terms.torque_limit is None and joint.unused == ()


def test_a_joint_that_is_twice_in_a_urdf_is_refused(tmp_path):
    path = tmp_path / "robot.urdf"
    joint = "\n<joint name='a' type='continuous'/>"
    path.write_text(f"<robot name='r'>{joint}{joint}</robot>")
    with pytest.raises(RigError, match="<joint name='a'> in line 3: joint 'a' is there twice"):
        read_joints(path, RigError)


@pytest.mark.parametrize(
    ("beside", "told"),
    [
        ("<joint name='g' type='gearbox'><parent>l</parent><child>m</child></joint>", "<joint name='g'>"),
        ("<drake:linear_spring_damper/>", "<drake:linear_spring_damper>"),
        ("<plugin name='pid'><joint_name>elbow</joint_name></plugin>", "<plugin name='pid'>"),
        ("<link name='tool'><gravity>false</gravity></link>", "gravity of <link name='tool'>"),
        ("<link name='tool'><velocity_decay><angular>1</angular></velocity_decay></link>", "velocity_decay of <link"),
        ("<joint name='f' type='revolute'><axis><mimic joint='elbow'/></axis></joint>", "that 'f' follows it (mimic)"),
        ("<joint name='f' type='revolute'><drake:mimic joint='elbow'/></joint>", "that 'f' follows it (mimic)"),
    ],
)
def test_what_acts_on_joints_of_an_sdf_file_from_beside_is_listed(tmp_path, beside, told):
    path = tmp_path / "arm.sdf"
    path.write_text(ARM.replace("</model>", f"{beside}</model>"))
    (unused,) = read_joints(path, RigError)["elbow"].unused
    assert told in unused


def test_a_file_whose_joints_are_of_other_types_says_so(tmp_path):
    path = tmp_path / "robot.sdf"
    joint = "<joint name='a' type='universal'><parent>world</parent><child>l</child></joint>"
    path.write_text(f"<sdf version='1.9'><model name='r'><link name='l'/>{joint}</model></sdf>")
    with pytest.raises(RigError, match="joints of the types universal are not read"):
        read_joints(path, RigError)
