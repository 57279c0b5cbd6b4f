"""URDF and SDFormat files that are drawn at random: one joint with what Drake's parsers know of it."""

import random

INERTIA = "<inertia ixx='0.01' iyy='0.01' izz='0.01' ixy='0' ixz='0' iyz='0'/>"


def drawn_urdf(seed: int) -> str:
    """The text of a URDF; its actuator has Drake's tags, those of ROS, or both."""
    r = random.Random(f"urdf {seed}")
    drawn = _drawn(r)
    ros = r.random() < 0.4 and drawn["rotor"]
    actuator = _attribute("drake:gear_ratio", drawn["ratio"]) + _attribute("drake:rotor_inertia", drawn["rotor"])
    if ros:  # what Drake does not read is no part of a run in Drake, so it stands beside Drake's own tags
        actuator += "<mechanicalReduction>50</mechanicalReduction><motorInertia>1e-5</motorInertia>"
    if drawn["p"]:
        actuator += f"<drake:controller_gains p='{drawn['p']}' d='{drawn['d']}'/>"
    dynamics = _attributes(damping=drawn["damping"], friction=drawn["friction"])
    limit = _attributes(effort=drawn["effort"], velocity=drawn["velocity"], lower="-9", upper="9")
    return (
        f"<robot name='r' xmlns:drake='http://drake.mit.edu'><link name='b'/><link name='l'><inertial><mass value='1'/>"
        f"{INERTIA}</inertial></link>\n<joint name='j' type='{r.choice(('revolute', 'continuous'))}'>"
        f"<parent link='b'/><child link='l'/><axis xyz='0 1 0'/>{f'<dynamics{dynamics}/>' if dynamics else ''}"
        f"<limit{limit}/></joint>\n<transmission name='t'><type>transmission_interface/SimpleTransmission</type>"
        f"<joint name='j'/><actuator name='a'>{actuator}</actuator></transmission></robot>"
    )


def drawn_sdf(seed: int) -> str:
    """The text of an SDFormat file, its joint's axis with a spring."""
    r = random.Random(f"sdf {seed}")
    drawn = _drawn(r)
    dynamics = _content("damping", drawn["damping"]) + _content("friction", drawn["friction"])
    if r.random() < 0.6:
        dynamics += _content("spring_stiffness", _number(r, 0.2, 3.0))
        dynamics += _content("spring_reference", _number(r, -0.3, 0.3)) if r.random() < 0.7 else ""
    drake = _content("drake:gear_ratio", drawn["ratio"]) + _content("drake:rotor_inertia", drawn["rotor"])
    if drawn["p"]:
        drake += f"<drake:controller_gains p='{drawn['p']}' d='{drawn['d']}'/>"
    limit = f"<limit>{_content('effort', drawn['effort'])}{_content('velocity', drawn['velocity'])}</limit>"
    inertia = "".join(f"<{name}>{0.01 if name[1] == name[2] else 0.0}</{name}>" for name in ("ixx", "iyy", "izz"))
    return (
        "<sdf version='1.9' xmlns:drake='http://drake.mit.edu'><model name='r'><link name='l'><inertial><mass>1</mass>"
        f"<inertia>{inertia}</inertia></inertial></link>\n<joint name='j' type='revolute'><parent>world</parent>"
        f"<child>l</child><axis><xyz>0 1 0</xyz><dynamics>{dynamics}</dynamics>{limit}</axis>{drake}</joint></model>"
        "</sdf>"
    )


def _drawn(r: random.Random) -> dict[str, str]:
    """Numbers as texts, empty where the file has none. A joint is damped, so that integrators do not matter."""
    servo = r.random() < 0.6
    return {
        "damping": _number(r, 0.1, 2.0),
        "friction": _number(r, 0.0, 0.5) if r.random() < 0.5 else "",
        "effort": _number(r, 0.5, 6.0) if r.random() < 0.7 else "1000",
        "velocity": _number(r, 1.0, 9.0) if r.random() < 0.3 else "",
        "ratio": _number(r, 1.0, 90.0) if r.random() < 0.7 else "",
        "rotor": _number(r, 1e-6, 2e-5) if r.random() < 0.8 else "",
        "p": _number(r, 2.0, 60.0) if servo else "",
        "d": _number(r, 0.05, 1.0) if r.random() < 0.7 else "0",
    }


def _number(r: random.Random, low: float, high: float) -> str:
    return f"{r.uniform(low, high):.4g}"


def _attributes(**values: str) -> str:
    return "".join(f" {name}='{value}'" for name, value in values.items() if value)


def _attribute(tag: str, value: str) -> str:
    return f"<{tag} value='{value}'/>" if value else ""


def _content(tag: str, value: str) -> str:
    return f"<{tag}>{value}</{tag}>" if value else ""
