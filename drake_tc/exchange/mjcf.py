"""MuJoCo's MJCF: joints and actuators of a user's file, or a bench of one hinge or slide a joint.

A joint has one actuator that is the identified drive, and one without input for its friction:

    position: force = kp (ctrl - q) - kv v as a whole within forcerange; timeconst filters ctrl
    pid:      the same with ki, the integral of the error
    motor:    force = gear ctrl, written with gear = kp, the torque for one unit of the drive's command
    general:  the same with a filter of ctrl
    dcmotor:  force = kt/R (ctrl - kt v), written where the torque constant is known; its limit is that of ctrl, because
              MuJoCo 3.17 does not apply the voltage of `saturation` to it
    dcmotor without input: a Stribeck peak F_C + (F_S - F_C) exp(-(v/v_S)^2) as `lugre`, a ripple as `cogging`

The drive takes the place of the file's own. Another actuator of the joint that brakes or holds it would act beside the
identified model: its gear is set to 0, so that controls and keyframes of the file keep their places. Default classes
hand on gear, gains, filters, delay and limits to every actuator, so whatever differs from MuJoCo's own default is
written out where a file has default classes. A limit of force or command that the model says nothing of stays the same
limit at the joint when the gear changes.

A torque constant kt takes a drive on a voltage apart: logs know kp = kt/R alone, and the back-EMF as a part of damping.

    kp V - damping v = kt/R (V - kt v) - (damping - kt^2/R) v,   R = kt/kp

MuJoCo's joint has armature, frictionloss and damping, whose three numbers d0, d1, d2 make the passive force
-(d0 + d1 |v| + d2 v^2) v. Its dry friction is a soft constraint: below frictionloss the velocity decays with a time
constant, 20 ms unless solreffriction says otherwise. The identified friction is rigid, so that two time steps are
written, the shortest that MuJoCo accepts. A spring along the joint is its stiffness with springref. What the file's
joint has of these and the model lacks goes, because the model was identified without it. That attributes are what this
module takes them for is tested in MuJoCo itself; `mujoco_run` has the versions that know them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from xml.dom import minidom

from drake_tc.errors import ParamsError
from drake_tc.exchange.projection import Loss, Projection, Vocabulary
from drake_tc.exchange.xml_text import append, child, imported, named, number, parsed, put, read_xml, to_text, top
from drake_tc.exchange.xml_text import element as new_element
from drake_tc.simulator_files.mjcf import (
    PLAY,
    MjcfJoint,
    disabled_groups,
    drive_of,
    gears_of,
    joints_of,
    terms_of_drive,
)
from drake_tc.simulator_files.mjcf_actuator import ACTUATORS, Actuator
from drake_tc.simulator_files.read import read_joints
from drake_tc.simulator_files.terms import Ripple, Terms
from drake_tc.simulator_files.xml_tree import Widths, in_degrees, included_path, states, xml_tree


@dataclass(frozen=True)
class DcMotor:
    """A motor on a voltage.

    Attributes:
        torque_constant: kt [N m/A], at the joint.
        resistance: R [Ohm].
        damping: Viscous friction without the back-EMF [N m s/rad].
    """

    torque_constant: float
    resistance: float
    damping: float


def dc_motor(terms: Terms) -> DcMotor | None:
    """The motor of a drive; None where it is not on a voltage, or its torque constant is not known."""
    kt = terms.torque_constant
    if terms.drive != "voltage" or kt is None:
        return None
    return DcMotor(kt, kt / terms.kp, terms.damping - kt * terms.kp)


def with_torque_constant(projection: Projection, torque_constant: float, target: Vocabulary) -> Projection:
    """The projection with the torque constant of a data sheet; a drive that is not on a voltage has no use for it.

    Args:
        projection: Of one joint.
        torque_constant: kt [N m/A].
        target: What it is projected to. Where the target or the drive has no use for the constant, this is one of the
            losses.

    Raises:
        ParamsError: not positive, or a back-EMF that exceeds the viscous friction.
    """
    if not 0.0 < torque_constant < float("inf"):
        raise ParamsError(f"export: --torque-constant: expected a positive number [N m/A], got {torque_constant:g}")
    if projection.terms.drive != "voltage":
        why = "the drive's input is not a voltage, so --torque-constant is not used"
        return replace(projection, losses=(*projection.losses, Loss("torque_constant", why)))
    terms = replace(projection.terms, torque_constant=torque_constant)
    motor = dc_motor(terms)
    if motor is not None and motor.damping < 0.0:
        raise ParamsError(
            f"export: a torque constant of {torque_constant:g} N m/A makes a back-EMF of"
            f" {terms.damping - motor.damping:.4g} N m s/rad, more than all viscous friction that was found"
            f" ({terms.damping:.4g}); give a smaller one"
        )
    if why := target.no_motor(terms):
        return replace(projection, losses=(*projection.losses, Loss("torque_constant", why)))
    return replace(projection, terms=terms)


ROUNDING = 1e-9
"""MuJoCo takes the sample before a delay has passed: rounding of a whole number of steps must not add one."""
FRICTION = "_friction"
"""End of the name of the actuator without input that is the friction of a joint."""
SMALL_CONSTANT = 1e-6
"""Motor constant of that actuator: MuJoCo wants one, and its back-EMF must be nothing [N m/A]."""
BRISTLE = 1e-3
"""Deflection of the bristles at which they slide [rad], [m]."""
BRISTLE_DAMPING = 5e-3
"""Damping of the bristles over their stiffness [s]: they neither ring nor brake what slides."""
OF_JOINT = ("joint", "jointinparent")
"""Attributes by which an actuator names its joint."""
GROUPS = 31
"""Groups of actuators that a file can switch off, from 0."""
OF_OTHERS = ("dampratio", "timeconst", "damping", "armature", "inheritrange")
"""Attributes of a servo or motor that the identified model replaces."""
OF_MOTORS = ("controller", "input", "nominal", "lugre", "cogging", "thermal", "saturation")


def put_actuator(root: minidom.Element, projection: Projection) -> Terms:
    """The drive of the joint and the actuator of its friction; the terms that are left to the joint."""
    joint = projection.joint
    mine = [node for group in _groups(root) for node in _elements(group) if joint in map(node.getAttribute, OF_JOINT)]
    mine = [node for node in mine if node.getAttribute("name") != joint + FRICTION]
    tree = xml_tree(root.toxml())
    read, switched_off = joints_of(tree), disabled_groups(tree)
    before = [each for each in read[joint].actuators if each.element.get("name") != joint + FRICTION]
    place = drive_of(before) or next(iter(before), None)
    for other, node in zip(before, mine, strict=True):
        if other is not place and other.enabled and _acts_without_command(other):
            put(node, gear="0")
        elif other is not place and (any(other.numbers("damping")) or any(other.numbers("armature"))):
            put(node, damping="0", armature="0")
    old = next((node for each, node in zip(before, mine, strict=True) if each is place), None)
    element = old or _appended(root, "position")
    if (place.values.get("group", "0") if place else "0") in switched_off:
        free = [name for name in map(str, range(GROUPS)) if name not in switched_off]
        if not free:
            raise ParamsError(
                f"{joint}: expected a group of actuators that is switched on; actuatorgroupdisable names all {GROUPS}"
            )
        put(element, group=free[0])
    if (place is not None and _has_states(place)) or projection.terms.lag or projection.terms.integral_rate:
        for key in root.getElementsByTagName("key"):
            put(key, act=None)
    left = _put_drive(element, projection, place, timestep(root))
    return _put_friction(root, left, joint)


def _acts_without_command(actuator: Actuator) -> bool:
    """Whether an actuator brakes or holds its joint also while its command is 0."""
    if actuator.gain is None:
        return actuator.kind not in ("damper", "muscle", "adhesion")
    return any(actuator.bias)


def _has_states(actuator: Actuator) -> bool:
    """Whether keyframes may have values `act` of an actuator."""
    return actuator.kind in ("pid", "dcmotor", "plugin", "muscle", "cylinder") or actuator.dynamics != "none"


def _put_drive(element: minidom.Element, projection: Projection, before: Actuator | None, step: float) -> Terms:
    """The drive; the terms that are left to the joint."""
    terms = projection.terms
    was = ("", {}) if before is None else (before.kind, dict(before.values))
    motor = None if was[1].get("forcerange") else dc_motor(terms)  # a dcmotor has no forcerange of its own
    servo = terms.drive == "position_servo"
    kind = ("pid" if terms.integral_rate else "position") if servo else "motor" if motor is None else "dcmotor"
    kind = "general" if kind == "motor" and terms.lag else kind
    if element.tagName != kind:
        element = _renamed(element, kind)
    if not element.hasAttribute("name"):
        put(element, name=projection.joint)
    put(element, joint=projection.joint, **dict.fromkeys((*OF_JOINT[1:], *OF_OTHERS)))
    inherits = _has_defaults(element)
    if inherits:
        put(element, damping="0", armature="0")
    if servo:
        _put_servo(element, terms, inherits=inherits)
        terms = replace(terms, damping=terms.damping - terms.derivative_gain)
    elif motor is not None:
        limit = 0.0 if terms.torque_limit is None else terms.torque_limit / terms.kp
        put(element, **dict.fromkeys(OF_MOTORS))
        put(element, motorconst=motor.torque_constant, resistance=motor.resistance, gear=1.0 if inherits else None)
        put(element, inductance=f"0 {number(terms.lag)}" if terms.lag else None)
        put(element, ctrlrange=f"{number(-limit)} {number(limit)}" if limit else None)
        if was[1].get("ctrlrange"):
            put(element, ctrllimited="true" if limit else "false")
    else:
        put(element, gear=terms.kp)
        if kind == "general":
            put(element, gaintype="fixed", gainprm="1", biastype="none", biasprm="0 0 0", dyntype="filterexact")
            put(element, dynprm=terms.lag)
    _put_delay(element, terms, step, was[1])
    if motor is not None:
        return replace(terms, damping=motor.damping)
    _put_limits(element, terms, before)
    return terms


def _put_servo(element: minidom.Element, terms: Terms, *, inherits: bool) -> None:
    kv = terms.derivative_gain
    put(element, kp=terms.kp, kv=kv if kv or inherits else None, gear=1.0 if inherits else None)
    if element.tagName == "pid":
        put(element, ki=terms.kp * terms.integral_rate, input="pos", imax=None, slewmax=None)
    elif terms.lag or inherits:
        put(element, timeconst=terms.lag)


def _put_friction(root: minidom.Element, terms: Terms, joint: str) -> Terms:
    """The actuator of the friction, or none; the terms without what it has."""
    named = [node for group in _groups(root) for node in _elements(group)]
    old = next((node for node in named if node.getAttribute("name") == joint + FRICTION), None)
    if terms.stribeck is None and terms.ripple is None:
        if old is not None and old.parentNode is not None:
            old.parentNode.removeChild(old)
        return terms
    made = old or _appended(root, "dcmotor")
    put(made, name=joint + FRICTION, joint=joint, input="none", motorconst=SMALL_CONSTANT, resistance=1.0)
    if _has_defaults(made):
        put(made, gear=1.0, damping="0", armature="0")
    if terms.stribeck is not None:
        put(made, lugre=" ".join(map(number, lugre_of(terms))))
    if terms.ripple is not None:
        put(made, cogging=" ".join(map(number, cogging_of(terms.ripple))))
    return replace(terms, frictionloss=0.0) if terms.stribeck is not None else terms


def lugre_of(terms: Terms) -> tuple[float, ...]:
    """Stiffness, damping, F_C, F_S and v_S of MuJoCo's `lugre` for the dry friction with its Stribeck peak."""
    height, velocity = (0.0, 1.0) if terms.stribeck is None else (terms.stribeck.height, terms.stribeck.velocity)
    least, most = terms.frictionloss, terms.frictionloss + height
    stiffness = most / BRISTLE
    return stiffness, BRISTLE_DAMPING * stiffness, least, most, velocity


def cogging_of(ripple: Ripple) -> tuple[float, ...]:
    """Amplitude, periods a turn and phase of MuJoCo's `cogging`."""
    phase = math.atan2(-ripple.cosine, -ripple.sine)
    return math.hypot(ripple.cosine, ripple.sine), ripple.cycles, phase


def _put_limits(element: minidom.Element, terms: Terms, old: Actuator | None) -> None:
    """The identified limit of torque, or the limit of the file; and the file's limits of a command of the same kind."""
    was: Mapping[str, str] = {} if old is None else old.values
    before = 1.0 if old is None else old.gear
    is_servo = element.tagName in ("position", "pid")
    after = 1.0 if is_servo else terms.kp
    renamed = old is None or old.kind != element.tagName
    if terms.torque_limit is not None:
        bound = terms.torque_limit / after
        put(element, forcerange=f"{number(-bound)} {number(bound)}")
        if was.get("forcelimited") == "false":
            put(element, forcelimited="true")
    elif was.get("forcerange") and (before != after or renamed):
        put(element, forcerange=_scaled(was["forcerange"], before / after))
    if not was.get("ctrlrange"):
        return
    drive = None if old is None else terms_of_drive(old)
    if old is None or drive is None or (drive.drive == "position_servo") != is_servo:  # an angle in place of a torque
        put(element, ctrlrange=None, ctrllimited="false" if _has_defaults(element) else None)
        return
    factor = 1.0 / before if is_servo else drive.kp / terms.kp
    if factor != 1.0 or renamed:
        put(element, ctrlrange=_scaled(was["ctrlrange"], factor))


def _put_delay(element: minidom.Element, terms: Terms, step: float, was: Mapping[str, str]) -> None:
    if terms.delay:
        put(element, delay=terms.delay * (1.0 - ROUNDING), nsample=str(math.ceil(terms.delay / step - 1e-9) + 1))
    elif float(was.get("delay") or 0.0) > 0.0:
        put(element, delay=0.0, nsample="0")


def _scaled(limits: str, factor: float) -> str:
    return " ".join(map(number, sorted(float(value) * factor for value in limits.split())))


def _renamed(element: minidom.Element, tag: str) -> minidom.Element:
    """The element under another tag, with what both kinds have."""
    made = new_element(element, tag)
    for name in ("name", "class", "group", "joint"):
        if element.hasAttribute(name):
            made.setAttribute(name, element.getAttribute(name))
    if element.parentNode is not None:
        element.parentNode.replaceChild(made, element)
    return made


def _elements(parent: minidom.Element) -> list[minidom.Element]:
    return [node for node in parent.childNodes if isinstance(node, minidom.Element) and node.tagName in ACTUATORS]


def _groups(root: minidom.Element) -> list[minidom.Element]:
    """All `<actuator>` sections: MuJoCo merges them."""
    return [node for node in root.childNodes if isinstance(node, minidom.Element) and node.tagName == "actuator"]


def _appended(root: minidom.Element, tag: str) -> minidom.Element:
    """A new actuator after all others, whose controls keep their places."""
    return append((_groups(root) or [child(root, "actuator")])[-1], tag)


def _has_defaults(element: minidom.Element) -> bool:
    """Whether default classes of the element's file have attributes of actuators."""
    tops = element.ownerDocument.getElementsByTagName("default") if element.ownerDocument else []
    return any(top.getElementsByTagName(tag) for top in tops for tag in ACTUATORS)


def timestep(root: minidom.Element) -> float:
    """Of the file [s]; MuJoCo's own is 2 ms."""
    options = root.getElementsByTagName("option")
    return [2e-3, *(float(each.getAttribute("timestep")) for each in options if each.hasAttribute("timestep"))][-1]


BENCH = """<mujoco model="drake_tc_bench">
  <compiler angle="radian"/>
  <option timestep="{step}" integrator="implicitfast"/>
  <worldbody/>
  <actuator/>
</mujoco>
"""
STEP = 1e-3
"""Of the bench [s]."""


def to_mjcf(projections: Sequence[Projection], into: Path | None = None, step: float = STEP) -> str:
    """The text of an MJCF file.

    Args:
        projections: One a joint.
        into: A user's file whose joints of these names get the terms, with what it includes in place of the includes;
            None writes a bench with one hinge or slide a joint and a link of next to no weight, to try the terms.
        step: Of the bench [s].

    Raises:
        ParamsError: a file that cannot be used, or that lacks a joint.
    """
    document = parsed(BENCH.format(step=number(step))) if into is None else read_xml(into, "mujoco")
    root = top(document)
    if into is None:
        _add_bench(root, projections)
    else:
        read_joints(into, ParamsError)  # refuses what is no number, and joints that other files make
        put_includes(root, into.parent)
    joints = named(document, "joint", ("body", "frame"))
    before = states(xml_tree(root.toxml()))
    for projection in projections:
        tree = xml_tree(root.toxml())
        read, degrees = joints_of(tree), in_degrees(tree)
        _check_type(read, projection, into)
        element = joints[projection.joint]
        gears = _gears(read, projection.joint, joints, degrees=degrees)
        unit = 180.0 / math.pi if degrees and projection.joint_type != "prismatic" else 1.0
        _joint(element, put_actuator(root, projection), timestep(root), unit)
        _gear(element, projection, gears.get("range"), (PLAY, 0.5 * projection.terms.backlash * unit))
        stiffness = 1.0 / projection.terms.compliance if projection.terms.compliance else 0.0
        _gear(element, projection, gears.get("stiffness"), (SPRING, stiffness))
    _put_keyframes(root, before, states(xml_tree(root.toxml())))
    return to_text(document)


def _put_keyframes(root: minidom.Element, before: Mapping[str, Widths], after: Mapping[str, Widths]) -> None:
    """Values of keyframes at the places that their joints have now; those of a hinge that was added are 0."""
    for key, (column, name) in product(root.getElementsByTagName("key"), enumerate(("qpos", "qvel"))):
        left = key.getAttribute(name).split()
        if not left or before == after:
            continue
        own = {}
        for joint, widths in before.items():
            own[joint], left = left[: widths[column]], left[widths[column] :]
        values = [value for joint, widths in after.items() for value in own.get(joint, ["0"] * widths[column])]
        put(key, **{name: " ".join(values + left)})


SPRING = "_elasticity"
"""End of the name of a hinge that is the compliance of a gear."""
NAMING = ("joint", "joint1", "joint2")
"""Attributes by which sensors, couplings and tendons name a joint."""


def put_includes(element: minidom.Element, *folders: Path) -> None:
    """Put the content of every included file in the place of its `<include>`.

    Args:
        element: Of a file that `read_joints` has read, so that there are all included files.
        folders: That of the file, and those of the files that include each other.
    """
    for node in [each for each in element.childNodes if isinstance(each, minidom.Element)]:
        found = included_path(node.getAttribute("file"), folders) if node.tagName == "include" else None
        if found is None:
            put_includes(node, *folders)
            continue
        other = imported(element, top(read_xml(found, "")))
        put_includes(other, *folders, found.parent)
        for each in list(other.childNodes):
            element.insertBefore(each, node)
        element.removeChild(node)


def _gears(
    read: Mapping[str, MjcfJoint], joint: str, joints: Mapping[str, minidom.Element], *, degrees: bool
) -> dict[str, minidom.Element]:
    """Joints beside the driven one that are its gear: the play under "range", the spring under "stiffness"."""
    mine = [name for name, driven in gears_of(read, degrees=degrees).items() if driven == joint]
    return {"stiffness" if any(read[name].numbers("stiffness")) else "range": joints[name] for name in mine}


def _check_type(read: Mapping[str, MjcfJoint], projection: Projection, into: Path | None) -> None:
    """Refuse a joint that is not there, or is of another type than the model's."""
    joint, own = projection.joint, "slide" if projection.joint_type == "prismatic" else "hinge"
    if joint not in read:
        listed = ", ".join(read) or "none"
        raise ParamsError(f"{into}: no hinge or slide <joint name={joint!r}>; joints: {listed}")
    if read[joint].kind != own:
        raise ParamsError(f"{into}: joint {joint!r} is a {read[joint].kind}; the model has a {own}")


def _add_bench(root: minidom.Element, projections: Sequence[Projection]) -> None:
    world = child(root, "worldbody")
    for projection in projections:
        body = append(world, "body")
        put(body, name=f"{projection.joint}_link")
        kind, axis = ("slide", "1 0 0") if projection.joint_type == "prismatic" else ("hinge", "0 1 0")
        put(append(body, "joint"), name=projection.joint, type=kind, axis=axis)
        put(append(body, "inertial"), pos="0 0 0", mass=1e-3, diaginertia="1e-6 1e-6 1e-6")


IMPEDANCE = "0.9 0.95 0.001 0.5 2"
"""Of the constraint that is dry friction: MuJoCo's default. A smaller one lets the joint creep."""


def _joint(element: minidom.Element, terms: Terms, step: float, unit: float) -> None:
    """The passive terms; a spring or a limit that a class hands on, and that the model lacks, is written as 0."""
    damping = _polynomial(element, "damping", terms.damping, terms.quadratic)
    put(element, armature=terms.armature, damping=damping, frictionloss=terms.frictionloss)
    if terms.frictionloss:
        soft = IMPEDANCE if _handed_on(element, "solimpfriction") else None
        put(element, solreffriction=f"{number(2.0 * step)} 1", solimpfriction=soft)
    if terms.torque_limit is not None:
        limited = "false" if _handed_on(element, "actuatorfrcrange") else None
        put(element, actuatorfrcrange=None, actuatorfrclimited=limited)
    springs = terms.stiffness or _handed_on(element, "stiffness")
    put(element, stiffness=_polynomial(element, "stiffness", terms.stiffness) if springs else None)
    rest = -terms.preload / terms.stiffness if terms.stiffness else 0.0
    put(element, springref=rest * unit if terms.stiffness else None, springyield=None)
    put(element, springdamper="0 0" if _handed_on(element, "springdamper") else None)


def _handed_on(element: minidom.Element, name: str) -> list[str]:
    """Values of an attribute in the default classes of joints."""
    document = element.ownerDocument
    tops = document.getElementsByTagName("default") if document is not None else []
    joints = [joint for each in tops for joint in each.getElementsByTagName("joint")]
    return [joint.getAttribute(name) for joint in joints if joint.hasAttribute(name)]


def _polynomial(element: minidom.Element, name: str, *values: float) -> str:
    """Numbers up to the last that is not 0, or as many as a class has, which hands on those that are left out."""
    used = [i + 1 for i, value in enumerate(values) if value]
    count = max([1, *used, *(len(text.split()) for text in _handed_on(element, name))])
    return " ".join(number(value) for value in (*values, *[0.0] * count)[:count])


def _gear(
    element: minidom.Element, projection: Projection, old: minidom.Element | None, gear: tuple[str, float]
) -> None:
    """A second hinge or slide about the same axis, after the driven one: the play or the spring of the gear, or none.

    Args:
        element: The driven joint.
        projection: Of the joint.
        old: That of the file; what names it goes with it.
        gear: `PLAY` or `SPRING`, the end of its name, and half of the play [rad], [deg] or [m], or the stiffness
            [N m/rad]; 0: there is none.
    """
    end, value = gear
    parent = element.parentNode
    if not isinstance(parent, minidom.Element):
        return
    if not value:
        every = [] if old is None or element.ownerDocument is None else element.ownerDocument.getElementsByTagName("*")
        for node in every:
            names = [node.getAttribute(each) for each in NAMING]
            if old is not None and (node is old or old.getAttribute("name") in names) and node.parentNode is not None:
                node.parentNode.removeChild(node)
        return
    made = old
    if made is None:
        made = new_element(element, "joint")
        put(
            made,
            **{each: element.getAttribute(each) for each in ("class", "axis", "pos") if element.hasAttribute(each)},
        )
        parent.insertBefore(made, element.nextSibling)  # type: ignore[arg-type]
    put(
        made,
        name=made.getAttribute("name") or projection.joint + end,
        type="slide" if projection.joint_type == "prismatic" else "hinge",
        damping=_polynomial(made, "damping"),
        armature="0",
        frictionloss="0",
        ref="0" if _handed_on(made, "ref") else None,
        springdamper="0 0" if _handed_on(made, "springdamper") else None,
    )
    if end == PLAY:
        put(made, range=f"{number(-value)} {number(value)}", limited="true")
    else:
        put(made, springref="0", limited="false", range=None)
    put(made, stiffness=_polynomial(made, "stiffness", value if end == SPRING else 0.0))
