"""MJCF files that are drawn at random: one joint, default classes, actuators of every kind that is read.

`more` draws further what MuJoCo has at one instant no torque of: delays, limits of the command, springdamper, forces
and actuators that are switched off, gears of one turn against the other, a second hinge that is the play or the spring
of a gear, friction and cogging of a motor, classes in classes, and what is no drive of a joint: dampers, adhesion,
actuators at sites and tendons, couplings, weights that are compensated.
"""

import random
import re

KINDS = ("position", "velocity", "motor", "general", "pid", "dcmotor", "intvelocity")


def drawn_mjcf(seed: int, *, more: bool = False) -> str:
    """The text of a file."""
    r = random.Random(seed)
    inner, nested = "", ""
    if r.random() < 0.6:
        inner = f"<joint {_joint(r)}/>" if r.random() < 0.7 else ""
        inner += "".join(f"<{kind} {_actuator(r, kind)}/>" for kind in r.sample(KINDS[:4], r.randint(0, 2)))
        if r.random() < 0.7:
            kind = r.choice(KINDS[:4])
            own = f"<joint {_joint(r)}/>" if r.random() < 0.6 else ""
            if kind in inner or not any(each in inner for each in KINDS):
                own += f"<{kind} {_actuator(r, kind)}/>"
            nested = f'<default class="c">{own}</default>'
    own = ' class="c"' if nested and r.random() < 0.6 else ""
    around = ' childclass="c"' if nested and r.random() < 0.5 else ""
    kind = r.choice(KINDS)
    further = random.Random(f"more of {seed}")
    drive, of_joint, option, gear = _more(further, kind) if more else ({}, {}, "", "")
    second, rest, groups = _others(further) if more else ("", "", "")
    if more and nested and further.random() < 0.5:
        nested = nested.replace("</default>", f'<default class="d"><joint {_joint(further)}/></default></default>')
        own, around = (each.replace('"c"', '"d"') for each in (own, around))
    actuators = f'<{kind} name="a" joint="j"{own} {_attributes(_pairs(_actuator(r, kind)) | drive)}/>'
    if kind in ("position", "general") and r.random() < 0.3:
        actuators += f'<velocity name="v" joint="j" kv="{_number(r, 0.1, 2.0)}"/>'
    actuators += second
    unit = '<compiler angle="radian"/>' if r.random() < 0.5 else ""
    return (
        f"<mujoco>{unit}<option gravity='0 0 0'{groups}>{option}</option>"
        f"<default>{inner}{nested}</default><worldbody><body{around}>"
        f"<joint name='j' axis='0 1 0' {_attributes(_pairs(_joint(r)) | of_joint)}/>{gear}"
        "<inertial pos='0 0 0' mass='1' diaginertia='0.01 0.01 0.01'/><site name='s'/></body></worldbody>"
        f"<actuator>{actuators}</actuator>{rest}</mujoco>"
    )


def with_includes(text: str) -> tuple[str, dict[str, str]]:
    """The text with its classes and its actuators in files that it includes, and these by name."""
    files = {}
    for tag in ("default", "actuator"):
        start, end = text.index(f"<{tag}>") + len(tag) + 2, text.rindex(f"</{tag}>")
        if start == end:
            continue  # MuJoCo refuses an empty file
        files[f"{tag}s.xml"] = f"<mujoco>{text[start:end]}</mujoco>"
        text = f"{text[:start]}<include file='{tag}s.xml'/>{text[end:]}"
    return text, files


def _others(r: random.Random) -> tuple[str, str, str]:
    """Further actuators, what couples joints, and groups that are switched off."""
    second, rest, groups = "", "", ""
    if r.random() < 0.04:
        second += f"<damper joint='j' kv='{_number(r, 0.1, 2.0)}' ctrlrange='0 1'/>"
    if r.random() < 0.04:
        second += f"<general site='s' gear='0 0 0 0 {_number(r, 1.0, 3.0)} 0'/>"
    if r.random() < 0.04:
        second += f"<position tendon='t' kp='{_number(r, 1.0, 9.0)}'/>"
        rest += "<tendon><fixed name='t'><joint joint='j' coef='2'/></fixed></tendon>"
    if r.random() < 0.1:
        second += f"<motor joint='j' gear='{_number(r, 1.0, 9.0)}' group='3'/>"
        groups = " actuatorgroupdisable='3 4'"
    return second, rest, groups


def _pairs(text: str) -> dict[str, str]:
    return dict(re.findall(r'(\w+)="([^"]*)"', text))


def _more(r: random.Random, kind: str) -> tuple[dict[str, str], dict[str, str], str, str]:
    """Attributes of the actuator and of the joint, flags, and a second hinge."""
    drive: dict[str, str] = {}
    if r.random() < 0.2:
        drive["gear"] = f"-{_number(r, 0.5, 4.0)}"
    if r.random() < 0.15 and kind != "dcmotor":
        drive |= {"forcerange": "-0.01 0.01", "forcelimited": "false"}
    if r.random() < 0.2 and kind in ("motor", "dcmotor"):
        limit = _number(r, 0.05, 0.15)
        drive["ctrlrange"] = f"-{limit} {limit}"
    if r.random() < 0.2 and kind in ("position", "motor"):
        drive |= {"delay": f"{0.001 * r.randint(2, 20)}", "nsample": "100"}
    if kind == "dcmotor" and r.random() < 0.3:
        drive["cogging"] = f"{_number(r, 0.01, 0.1)} {r.randint(4, 9)} {_number(r, -1.0, 1.0)}"
    if kind == "dcmotor" and r.random() < 0.3:
        drive["inductance"] = _number(r, 0.001, 0.004)
    joint = {}
    if r.random() < 0.1:
        joint |= {"springdamper": f"{_number(r, 0.2, 1.0)} {_number(r, 0.3, 1.5)}"}
    flags = [name for name in ("spring", "damper", "frictionloss") if r.random() < 0.05]
    option = "<flag " + " ".join(f"{name}='disable'" for name in flags) + "/>" if flags else ""
    gear = ""
    if r.random() < 0.2:
        own = {
            "flex": f"stiffness='{_number(r, 100.0, 400.0)}'",
            "play": "stiffness='0' limited='true' range='-0.01 0.01'",
        }
        name = "flex" if r.random() < 0.5 else "play"
        still = "damping='0' armature='0' frictionloss='0' actuatorfrclimited='false' springref='0'"
        gear = f"<joint name='{name}' class='main' axis='0 1 0' {still} {own[name]}/>"
    return drive, joint, option, gear


def _number(r: random.Random, low: float, high: float) -> str:
    return f"{r.uniform(low, high):.4g}"


def _joint(r: random.Random) -> str:
    found = {}
    for name, high in (("armature", 0.2), ("damping", 2.0), ("frictionloss", 0.5), ("stiffness", 3.0)):
        if r.random() < 0.5:
            found[name] = _number(r, 0.0, high)
    if r.random() < 0.2:
        found["damping"] = f"{_number(r, 0.0, 1.0)} {_number(r, 0.0, 1.0)}"
    if r.random() < 0.3:
        found["springref"] = _number(r, -20.0, 20.0)
    if r.random() < 0.15:
        limit = _number(r, 0.5, 5.0)
        found["actuatorfrcrange"] = f"-{limit} {limit}"
    return _attributes(found)


def _actuator(r: random.Random, kind: str) -> str:
    found = {}
    if kind in ("position", "pid", "intvelocity") and r.random() < 0.8:
        found["kp"] = _number(r, 1.0, 50.0)
    if kind in ("position", "pid") and r.random() < 0.5:
        ratio = r.random() > 0.7
        found["dampratio" if ratio else "kv"] = _number(r, 0.1, 2.0)
    if kind == "velocity" and r.random() < 0.8:
        found["kv"] = _number(r, 0.1, 3.0)
    if kind == "position" and r.random() < 0.2:
        found["timeconst"] = _number(r, 0.01, 0.1)
    if kind == "pid" and r.random() < 0.5:
        found["ki"] = _number(r, 1.0, 5.0)
    if kind == "general" and r.random() < 0.8:
        found["gainprm"] = gain = _number(r, 1.0, 50.0)
        if r.random() < 0.6:
            found |= {"biastype": "affine", "biasprm": f"0 -{gain} -{_number(r, 0.1, 2.0)}"}
        if r.random() < 0.2:
            found |= {"dyntype": "filter", "dynprm": _number(r, 0.01, 0.1)}
    if kind == "dcmotor":
        found |= {"motorconst": _number(r, 0.1, 1.0), "resistance": _number(r, 1.0, 4.0)}
    elif r.random() < 0.3:
        limit = _number(r, 0.5, 5.0)
        found["forcerange"] = f"-{limit} {limit}"
    for name, low, high, often in (("gear", 0.5, 4.0, 0.3), ("damping", 0.1, 1.0, 0.15), ("armature", 0.01, 0.1, 0.15)):
        if r.random() < often:
            found[name] = _number(r, low, high)
    return _attributes(found)


def _attributes(found: dict[str, str]) -> str:
    return " ".join(f'{name}="{value}"' for name, value in found.items())
