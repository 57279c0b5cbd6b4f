"""MuJoCo with a written file, or with a bench of a joint's terms as `to_mjcf` writes them, and the version it needs.

    delay of an actuator                                               MuJoCo 3.5
    damping of more than one number (a polynomial of the speed)        MuJoCo 3.7
    <dcmotor>                                                          MuJoCo 3.7
    <dcmotor> without input, <pid>                                     MuJoCo 3.12

Each version loads a file with the term and gives the force that it means; the version before refuses the file.
"""

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any
from xml.dom import minidom

import numpy as np

from drake_tc.actuation.recorded_run import Link
from drake_tc.errors import ParamsError
from drake_tc.exchange.mjcf import STEP, to_mjcf
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.target_run import PointMass, RunInput, WrittenFile
from drake_tc.exchange.xml_text import parsed
from drake_tc.simulator_files.mjcf import PLAY, drive_of, gears_of, joints_of
from drake_tc.simulator_files.mjcf_actuator import ACTUATORS
from drake_tc.simulator_files.terms import Terms
from drake_tc.simulator_files.xml_tree import in_degrees, mujoco_module, xml_tree
from drake_tc.types import FloatArray

Version = tuple[int, ...]
DELAY = "the delay of an actuator"
POLYNOMIAL = "damping as a polynomial of the speed"
DCMOTOR = "the actuator dcmotor"
PASSIVE = "friction as a dcmotor without input"
PID = "the actuator pid"
SINCE: dict[str, Version] = {PASSIVE: (3, 12), PID: (3, 12), POLYNOMIAL: (3, 7), DCMOTOR: (3, 7), DELAY: (3, 5)}
"""Term of an MJCF file to the first version that has it, newest first."""


def installed_mujoco() -> str | None:
    """Version of MuJoCo in this Python; None where it is not installed."""
    try:
        return version("mujoco")
    except PackageNotFoundError:
        return None


def version_sentence(text: str, joints: Sequence[str], *, installed: str | None) -> str:
    """The version that the terms of these joints in a file need, and whether it is installed; "" where any has them."""
    needs = _needs(text, joints)
    if not needs:
        return ""
    by_version: dict[Version, list[str]] = {}
    for term, names in needs.items():
        by_version.setdefault(SINCE[term], []).append(f"{term} ({', '.join(names)})")
    needed = "; ".join(f"{_dotted(since)} or newer for {' and '.join(terms)}" for since, terms in by_version.items())
    told = f"; MuJoCo {installed} is installed, which refuses it" if too_old(text, joints, installed=installed) else ""
    return f"The file needs MuJoCo {needed}{told}."


def too_old(text: str, joints: Sequence[str], *, installed: str | None) -> str:
    """Why the installed version cannot load the file, as a clause; "" where it can."""
    if installed is None:
        return ""
    newer = [term for term in _needs(text, joints) if _numbers(installed) < SINCE[term]]
    if not newer:
        return ""
    needed = _dotted(max(SINCE[term] for term in newer))
    return f"MuJoCo {installed} is installed, but {needed} or newer is needed for {' and '.join(newer)}"


def file_notes(text: str, projections: Sequence[Projection], into: Path | None = None) -> list[str]:
    """Sentences on the version of MuJoCo that a file needs, on a dcmotor that the file cannot have, and on a refusal.

    Args:
        text: Of an MJCF file.
        projections: What was written into it.
        into: The user's file, of which this one is made; None: it is a bench.
    """
    joints, installed = [each.joint for each in projections], installed_mujoco()
    needed = version_sentence(text, joints, installed=installed)
    notes = [*([needed] if needed else []), *_plain_motors(text, projections)]
    if into is None or installed is None or too_old(text, joints, installed=installed):
        return notes
    try:
        compiled(text, into.parent)
    except ParamsError as problem:
        notes.append(f"The written file cannot be loaded: {problem}.")
    return notes


def _plain_motors(text: str, projections: Sequence[Projection]) -> list[str]:
    """Sentences on drives that could be a dcmotor but for the limit of force that the user's file has."""
    drives = [each for each in _elements(text, ACTUATORS) if each.getAttribute("input") != "none"]
    kinds = {each.getAttribute("joint"): each.tagName for each in drives}
    return [
        f"{each.joint}: the file limits the force of the actuator, which MuJoCo's dcmotor cannot: a motor was written,"
        " and the back-EMF stays a part of the damping."
        for each in projections
        if each.terms.drive == "voltage" and each.terms.torque_constant and kinds.get(each.joint) != "dcmotor"
    ]


def _needs(text: str, joints: Sequence[str]) -> dict[str, list[str]]:
    """Term to the joints that have it, in the order of `SINCE`."""
    found: dict[str, list[str]] = {term: [] for term in SINCE}
    for element in _elements(text, ("joint",)):
        name = element.getAttribute("name").removesuffix(PLAY)
        if len(element.getAttribute("damping").split()) > 1:
            found[POLYNOMIAL].append(name)
    for element in _elements(text, ACTUATORS):
        name, passive = element.getAttribute("joint"), element.getAttribute("input") == "none"
        kinds = {"dcmotor": PASSIVE if passive else DCMOTOR, "pid": PID}
        terms = [kinds[element.tagName]] if element.tagName in kinds else []
        for term in (*terms, *([DELAY] if element.hasAttribute("delay") else [])):
            found[term].append(name)
    found = {term: [name for name in dict.fromkeys(names) if name in joints] for term, names in found.items()}
    return {term: names for term, names in found.items() if names}


def _elements(text: str, tags: Sequence[str]) -> list[minidom.Element]:
    document = parsed(text)
    return [element for tag in tags for element in document.getElementsByTagName(tag)]


def _numbers(dotted: str) -> Version:
    """(3, 17) of "3.17.0"."""
    return tuple(int(part) for part in re.findall(r"\d+", dotted)[:2])


def _dotted(numbers: Version) -> str:
    return ".".join(map(str, numbers))


LOCKED = 1e9
"""Armature of joints that stand still in a run [kg m^2]."""
WEIGHTLESS = 1e-9
"""Mass and moments of inertia of links in a run whose load is recorded [kg], [kg m^2]."""


def simulate_in_mujoco(terms: Terms, pendulum: Link | None, given: RunInput) -> FloatArray:
    """(T,) position of one joint in MuJoCo [rad]; NaN from where the simulation is unstable.

    Args:
        terms: Of its actuator, written into a bench.
        pendulum: On the joint; None leaves the rotor alone.
        given: What moves it.

    Raises:
        ParamsError: MuJoCo is not installed, is too old for a term, or refuses the model.
    """
    require_mujoco()
    if old := too_old_for(terms):
        raise ParamsError(f"{old}; pip install 'drake-tc[mujoco]'")
    text = _bench(terms, given.step).replace(_LIGHT, _inertial(pendulum))
    return _simulate(WrittenFile(text, "joint"), given, recorded_load=pendulum is None)


def simulate_mjcf(file: WrittenFile, pendulum: Link | None, given: RunInput) -> FloatArray:
    """The same with a file as it is written; its other joints stand still.

    Args:
        file: With its own links, which are the load where the rig has a pendulum.
        pendulum: Of the rig; None: the load is recorded, and the links of the file weigh nothing.
        given: What moves it; the position is that behind the gear.

    Raises:
        ParamsError: MuJoCo is not installed, or refuses the file.
    """
    return _simulate(file, given, recorded_load=pendulum is None)


def _simulate(file: WrittenFile, given: RunInput, *, recorded_load: bool) -> FloatArray:
    mujoco: Any = require_mujoco()
    tree = xml_tree(file.text)
    joints = joints_of(tree)
    gears = [name for name, driven in gears_of(joints, degrees=in_degrees(tree)).items() if driven == file.joint]
    drive = drive_of(joints[file.joint].actuators)
    if drive is None:
        raise ParamsError(f"joint {file.joint} has no actuator that takes the command of the drive")

    def with_steps(spec: Any) -> None:
        spec.option.timestep = given.step
        for actuator in spec.actuators:
            if actuator.delay > 0.0:
                actuator.nsample = max(actuator.nsample, math.ceil(actuator.delay / given.step) + 1)

    model = compiled(file.text, file.folder, with_steps)
    data = mujoco.MjData(model)
    at = model.joint(file.joint)
    moved = [at, *(model.joint(name) for name in gears if not recorded_load)]
    coupled = [model.joint(name) for name in _coupled(tree, file.joint)]
    free = {each.dofadr[0] for each in (*moved, *coupled)}
    model.dof_armature[[i for i in range(model.nv) if i not in free]] = LOCKED
    if recorded_load:
        model.body_mass[1:], model.body_inertia[1:], model.opt.gravity[:] = WEIGHTLESS, WEIGHTLESS, 0.0
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    number = drive.number
    control = int(model.actuator_ctrladr[number]) if hasattr(model, "actuator_ctrladr") else number
    unit = drive.gear if drive.is_servo or drive.kind == "pid" else 1.0
    data.qpos[at.qposadr[0]], data.qvel[at.dofadr[0]] = given.start
    first = unit * given.command[0]
    if drive.filter:  # before the run the command was its first one; MuJoCo's own history is 0
        data.act[model.actuator_actadr[number]] = first
    if drive.first("delay") > 0.0:
        samples = int(model.actuator_history[number, 0])
        mujoco.mj_initCtrlHistory(model, data, number, None, np.full(samples, first))
    seen, pushed = [each.qposadr[0] for each in moved], [each.dofadr[0] for each in moved]
    position = np.full(given.command.size, np.nan)
    with _warnings(mujoco) as told:
        for i in range(position.size):
            position[i] = data.qpos[seen].sum()
            data.ctrl[control], data.qfrc_applied[pushed] = unit * given.command[i], -given.load[i]
            for _ in range(given.substeps):
                mujoco.mj_step(model, data)
            if told and _is_unstable(mujoco, data):  # it would go on from its initial state
                break
    return position


def compiled(text: str, folder: Path | None, change: Callable[[Any], None] = lambda _spec: None) -> Any:
    """MuJoCo's model of a file.

    Args:
        text: Of the file.
        folder: In which the file finds its meshes; None: it needs none.
        change: Of the parsed file, before it is compiled.

    Raises:
        ParamsError: MuJoCo is not installed, or refuses the file.
    """
    mujoco: Any = require_mujoco()
    try:
        spec = mujoco.MjSpec.from_string(text)
        if folder is not None:
            spec.modelfiledir = str(folder)
        change(spec)
        with _warnings(mujoco):
            return spec.compile()
    except ValueError as error:
        raise ParamsError(f"MuJoCo refuses the file: {' '.join(str(error).split())}") from None


def _coupled(tree: ET.Element, joint: str) -> set[str]:
    """Joints that an equality couples to the joint."""
    found = set()
    for each in tree.iterfind("equality/joint"):
        names = {each.get("joint1", ""), each.get("joint2", "")} - {""}
        found |= names if joint in names else set()
    return found - {joint}


def too_old_for(terms: Terms) -> str:
    """Why the installed MuJoCo cannot load these terms, as a clause; "" where it can."""
    return too_old(_bench(terms, STEP), ["joint"], installed=installed_mujoco())


def _bench(terms: Terms, step: float) -> str:
    return to_mjcf([Projection("joint", terms, (), None)], step=step)


_LIGHT = '<inertial pos="0 0 0" mass="0.001" diaginertia="1e-6 1e-6 1e-6"/>'


def _inertial(pendulum: Link | None) -> str:
    """MJCF of the link, about the axis y."""
    if pendulum is None:
        return '<inertial pos="0 0 0" mass="0.001" diaginertia="1e-09 1e-09 1e-09"/>'
    link = PointMass.of(pendulum)
    centre, own = (" ".join(f"{value:.12g}" for value in each) for each in (link.centre(), 3 * (link.inertia,)))
    return f'<inertial pos="{centre}" mass="{link.mass:.12g}" diaginertia="{own}"/>'


@contextmanager
def _warnings(mujoco: Any) -> Iterator[list[str]]:
    """MuJoCo's warnings in the block as a list; without it MuJoCo writes MUJOCO_LOG.TXT into the working directory."""
    told: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(told.append)
    try:
        yield told
    finally:
        mujoco.set_mju_user_warning(before)


def _is_unstable(mujoco: Any, data: Any) -> bool:
    """Whether a position, velocity or acceleration was not finite or huge."""
    kinds = mujoco.mjtWarning
    bad = (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)
    return any(data.warning[int(kind)].number > 0 for kind in bad)


def require_mujoco() -> Any:
    """The module.

    Raises:
        ParamsError: MuJoCo is not installed.
    """
    try:
        return mujoco_module()
    except (ImportError, OSError):
        raise ParamsError("running the export needs MuJoCo: pip install 'drake-tc[mujoco]'") from None
