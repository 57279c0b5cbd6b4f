"""Masses and inertias of links that were found, in the user's file: physically consistent, or named as lost.

`drake_tc.robot.link_changes` has the equations; how far a body that exists is from what was found is told.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from xml.dom import minidom

import numpy as np
from pydrake.multibody.tree import BodyIndex

from drake_tc.errors import ParamsError
from drake_tc.exchange.drake_run import loaded, refusing
from drake_tc.exchange.mujoco_run import compiled, require_mujoco
from drake_tc.exchange.xml_text import append, child, element, named, number, parsed, put, text, to_text, top
from drake_tc.robot.link_changes import NAMES, central, changed, consistent, parameters_of
from drake_tc.types import FloatArray

OF_SENSORS = ("ft_bias", "ft_gain", "ft_alignment", "imu_bias", "imu_gain", "imu_alignment", "encoder_offset")


@dataclass(frozen=True)
class Body:
    """A link of the user's file.

    Attributes:
        own: (10,) its parameters.
        whole: (10,) those of the link with all that is welded to it.
        write: Puts (10,) new own parameters into the document.
    """

    own: FloatArray
    whole: FloatArray
    write: Callable[[FloatArray], None]


def with_links(
    written: str,
    target: str,
    into: Path | None,
    shared: Sequence[Mapping[str, Any]],
    links: Mapping[str, Mapping[str, Any]],
) -> tuple[str, list[str]]:
    """The text with the links' parameters that were found, and sentences on what was written and what is lost.

    Args:
        written: Text of the export.
        target: Name on the command line.
        into: The user's file; None: the text is a bench, which has none of the links.
        shared: Entries of the model file.
        links: The same.
    """
    told = [f"{_named(each)}: an error of the sensor, not of the robot." for each in shared if _of_sensor(each)]
    causes = [each for each in shared if not _of_sensor(each)]
    if not causes and not links:
        return written, told
    where = list(dict.fromkeys([str(each.get("where")) for each in causes] + list(links)))
    try:
        (bodies, text_of), reason = _bodies(written, target, into, where), ""
    except ParamsError as error:
        bodies, text_of, reason = {}, lambda: written, str(error)
    for name in where:
        mine = [each for each in causes if each.get("where") == name]
        if name not in bodies:
            why = reason or f"{into.name if into else 'the file'} has no link, or several links, of this name"
            told += [f"{_named(each)} was not written: {why}." for each in mine]
            told += [f"{name}: its fitted inertial parameters are not written: {why}."] if name in links else []
            continue
        told += _put(name, bodies[name], mine, links.get(name))
    return text_of(), told


def _put(name: str, body: Body, causes: Sequence[Mapping[str, Any]], fitted: Mapping[str, Any] | None) -> list[str]:
    whole, told = body.whole.copy(), []
    if fitted is not None:
        whole = np.array([float(fitted.get(each, value)) for each, value in zip(NAMES, whole, strict=True)])
        told.append(f"{name}: its fitted inertial parameters were written")
    for cause in causes:
        found = changed(whole, cause)
        if found is None or found[0] <= 0.0:
            told.append(f"{_named(cause)} was not written: it cannot be applied to a link of {whole[0]:.4g} kg")
            continue
        whole = found
        told.append(f"{_named(cause)} was written")
    if np.array_equal(whole, body.whole):
        return [f"{line}." for line in told]
    own = consistent(body.own + whole - body.whole)
    body.write(own)
    moved = np.abs(own - (body.own + whole - body.whole)).max()
    impossible = f"; no rigid body has these parameters, and the written ones differ by up to {moved:.2g} (SI units)"
    lost = impossible if moved > 1e-9 else ""
    mass = f"; the mass of the link is now {own[0]:.4g} kg instead of {body.own[0]:.4g} kg"
    return [f"{line}{lost}{mass}." if line is told[-1] else f"{line}." for line in told]


def _of_sensor(cause: Mapping[str, Any]) -> bool:
    return cause.get("effect") in OF_SENSORS


def _named(cause: Mapping[str, Any]) -> str:
    values = ", ".join(
        f"{name} {value:+.4g}" for name, value in cause.items() if isinstance(value, float | int) and name != "ci95"
    )
    return f"{cause.get('where')}: {str(cause.get('effect')).replace('_', ' ')} ({values})"


def _bodies(
    written: str, target: str, into: Path | None, names: Sequence[str]
) -> tuple[dict[str, Body], Callable[[], str]]:
    """Links of the file by name, and what gives its text when they are written.

    Raises:
        ParamsError: a target without links, or a file that cannot be loaded.
    """
    if target not in ("mjcf", "urdf", "drake-urdf", "sdf"):
        raise ParamsError("the target has actuators only: change the link in the robot's model")
    if into is None:
        raise ParamsError("a bench has no links: name the robot's file with --into")
    document = parsed(written)
    found = _of_drake(written, document, names) if target != "mjcf" else _of_mjcf(top(document), into, names)
    return found, lambda: to_text(document)


def _of_drake(written: str, document: minidom.Document, names: Sequence[str]) -> dict[str, Body]:
    """Links of a URDF or SDFormat file, by Drake's parser."""
    plant = loaded(written)
    with refusing():
        plant.Finalize()
    elements = named(document, "link", ("robot", "model"))
    bodies = [plant.get_body(index).name() for index in map(BodyIndex, range(plant.num_bodies()))]
    found = {}
    for name in names:
        if name not in elements or bodies.count(name) != 1:
            continue
        own, whole = parameters_of(plant, name)
        write = _write_urdf if top(document).tagName == "robot" else _write_sdf
        found[name] = Body(own, whole, partial(write, elements[name]))
    return found


def _fresh(link: minidom.Element) -> minidom.Element:
    """An `<inertial>` of the link without content."""
    old = [node for node in link.childNodes if isinstance(node, minidom.Element) and node.tagName == "inertial"]
    made = element(link, "inertial")
    if old:
        link.replaceChild(made, old[0])
    else:
        link.insertBefore(made, link.firstChild)
    return made


MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def _write_urdf(link: minidom.Element, parameters: FloatArray) -> None:
    mass, centre, about = central(parameters)
    made = _fresh(link)
    put(append(made, "origin"), xyz=" ".join(map(number, centre)), rpy="0 0 0")
    put(append(made, "mass"), value=mass)
    put(append(made, "inertia"), **dict(zip(MOMENTS, about[np.triu_indices(3)].tolist(), strict=True)))


def _write_sdf(link: minidom.Element, parameters: FloatArray) -> None:
    mass, centre, about = central(parameters)
    made = _fresh(link)
    append(made, "pose").appendChild(text(made, " ".join(map(number, (*centre, 0.0, 0.0, 0.0)))))
    append(made, "mass").appendChild(text(made, number(mass)))
    inertia = child(made, "inertia")
    for tag, value in zip(MOMENTS, about[np.triu_indices(3)].tolist(), strict=True):
        append(inertia, tag).appendChild(text(made, number(value)))


def _of_mjcf(root: minidom.Element, into: Path, names: Sequence[str]) -> dict[str, Body]:
    """Bodies of an MJCF file, by MuJoCo's compiler."""
    mujoco: Any = require_mujoco()

    def with_all_bodies(spec: Any) -> None:
        spec.compiler.fusestatic = False

    for each in root.getElementsByTagName("compiler"):
        if each.getAttribute("inertiafromgeom") == "true" or each.getAttribute("settotalmass"):
            raise ParamsError("the file's compiler makes its inertias (inertiafromgeom, settotalmass)")
    model = compiled(root.toxml(), into.parent, with_all_bodies)
    elements = {each.getAttribute("name"): each for each in root.getElementsByTagName("body")}
    numbers = {model.body(i).name: i for i in range(model.nbody)}
    found = {}
    for name in names:
        if name not in elements or name not in numbers:
            continue
        own = _moved(mujoco, model, numbers[name], numbers[name])
        welded = (_moved(mujoco, model, at, numbers[name]) for at in _welded(model, numbers[name]))
        whole = own + sum(welded, np.zeros(len(NAMES)))
        found[name] = Body(own, whole, partial(_write_mjcf, elements[name]))
    return found


def _welded(model: Any, body: int) -> list[int]:
    """Bodies that hang from a body without a joint."""
    found = [i for i in range(1, model.nbody) if model.body_parentid[i] == body and model.body_jntnum[i] == 0]
    return found + [deeper for i in found for deeper in _welded(model, i)]


def _moved(mujoco: Any, model: Any, body: int, to: int) -> FloatArray:
    """(10,) of a body in its own frame, or in that of the body that carries it without a joint."""
    turn, mass = np.zeros(9), float(model.body_mass[body])
    mujoco.mju_quat2Mat(turn, model.body_iquat[body])
    axes, centre, principal = turn.reshape(3, 3).copy(), np.array(model.body_ipos[body]), model.body_inertia[body]
    while body != to:
        mujoco.mju_quat2Mat(turn, model.body_quat[body])
        axes, centre = turn.reshape(3, 3) @ axes, turn.reshape(3, 3) @ centre + model.body_pos[body]
        body = int(model.body_parentid[body])
    inertia = axes @ np.diag(principal) @ axes.T + mass * ((centre @ centre) * np.eye(3) - np.outer(centre, centre))
    return np.array([mass, *(mass * centre), *inertia[np.triu_indices(3)]])


def _write_mjcf(body: minidom.Element, parameters: FloatArray) -> None:
    mass, centre, about = central(parameters)
    full = (about[0, 0], about[1, 1], about[2, 2], about[0, 1], about[0, 2], about[1, 2])
    put(
        _fresh(body),
        pos=" ".join(map(number, centre)),
        mass=mass,
        fullinertia=" ".join(number(float(value)) for value in full),
    )
