"""Inertial parameters of links that were found: what they make of a link, and of the URDF that a plant is built from.

A link's ten parameters are pi = [m, m c, I] about its origin in its own frame, I as it stands in the matrix. A model
file has differences to the robot's model under `shared` and whole parameters under `links`:

    link_mass   pi' = pi (1 + delta/m)                    the shape and the centre of mass stay
    link_com    c' = c + delta                            mass and inertia about the centre of mass stay
    payload     pi' = pi + [m, m c, m (c.c 1 - c c^T)]    a point mass m at c
    links       pi' of the link with all that is welded to it

What is welded to a link keeps its own inertia. A body exists with pi' if its pseudo-inertia
[[tr(I)/2 1 - I, m c], [m c^T, m]] has no negative eigenvalue (Wensing, Kim and Slotine, 2018, eq. 14); negative ones
are set to a small positive number.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant

from drake_tc.actuation.model_file import OF_LINKS, load_model_file
from drake_tc.config.quoted import did_you_mean
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

NAMES = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
SMALLEST = 1e-6
"""Least eigenvalue of a pseudo-inertia over its largest one."""
ROUNDING = 1e-8
"""The same of one that stays positive with the digits of a file; a point mass or a plate without thickness has 0."""


@dataclass(frozen=True)
class LinkChanges:
    """What a model file says of the links of a robot.

    Attributes:
        causes: Entries `{effect, where, <parameter>: number}` of `OF_LINKS`.
        fitted: By link, whole inertial parameters.
        source: The model file, for messages.
    """

    causes: tuple[Mapping[str, Any], ...] = ()
    fitted: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    source: Path | None = None

    @property
    def links(self) -> tuple[str, ...]:
        """Links that change."""
        return tuple(dict.fromkeys([str(cause.get("where")) for cause in self.causes] + list(self.fitted)))

    def applied(self, link: str, whole: FloatArray) -> FloatArray:
        """(10,) parameters of a link with all that is welded to it, changed.

        Args:
            link: Its name.
            whole: (10,) as the robot's file has them.

        Raises:
            ParamsError: a mass that would be negative.
        """
        fitted = self.fitted.get(link, {})
        pi = np.array([float(fitted.get(name, value)) for name, value in zip(NAMES, whole, strict=True)])
        for cause in self.causes:
            if cause.get("where") == link:
                found = changed(pi, cause)
                if found is None or found[0] < 0.0:
                    raise ParamsError(
                        f"{self.source}: shared: link {link!r} of {pi[0]:g} kg cannot be changed by {dict(cause)}"
                    )
                pi = found
        return pi


def link_changes(path: Path) -> LinkChanges:
    """What a model file says of links; nothing for most files.

    Raises:
        ParamsError: the file cannot be read.
    """
    file = load_model_file(path)
    causes = tuple(each for each in file.shared if each.get("effect") in OF_LINKS)
    return LinkChanges(causes, file.links, path)


def changed(whole: FloatArray, cause: Mapping[str, Any]) -> FloatArray | None:
    """(10,) parameters with one cause of `OF_LINKS` and its numbers; None for one that is no change of them."""
    kind = cause.get("effect")
    if kind == "link_mass" and whole[0] > 0.0:
        return np.asarray(whole * (1.0 + float(cause["mass"]) / whole[0]))
    if kind == "link_com" and whole[0] > 0.0:
        moved = whole.copy()
        centre = whole[1:4] / whole[0]
        new = centre + _centre(cause)
        moved[1:4] = whole[0] * new
        moved[4:] += whole[0] * (_points(new) - _points(centre))
        return moved
    if kind == "payload":
        mass, place = float(cause["mass"]), _centre(cause)
        return np.asarray(whole + mass * np.array([1.0, *place, *_points(place)]))
    return None


def _centre(cause: Mapping[str, Any]) -> FloatArray:
    return np.array([float(cause[f"com_{axis}"]) for axis in "xyz"])


def _points(c: FloatArray) -> FloatArray:
    """(6,) inertia of a unit mass at c."""
    matrix = (c @ c) * np.eye(3) - np.outer(c, c)
    return np.asarray(matrix[np.triu_indices(3)])


def consistent(parameters: FloatArray) -> FloatArray:
    """(10,) the nearest parameters that a body can have; the same where it can have them.

    Args:
        parameters: (10,).
    """
    inertia = _matrix(parameters)
    pseudo = np.zeros((4, 4))
    pseudo[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    pseudo[:3, 3] = pseudo[3, :3] = parameters[1:4]
    pseudo[3, 3] = parameters[0]
    values, vectors = np.linalg.eigh(pseudo)
    least = SMALLEST * max(float(values[-1]), 1e-3)
    if values[0] >= ROUNDING * values[-1]:
        return parameters
    pseudo = vectors @ np.diag(np.maximum(values, least)) @ vectors.T
    second = pseudo[:3, :3]
    inertia = np.trace(second) * np.eye(3) - second
    return np.array([pseudo[3, 3], *pseudo[:3, 3], *inertia[np.triu_indices(3)]])


def _matrix(parameters: FloatArray) -> FloatArray:
    xx, xy, xz, yy, yz, zz = parameters[4:]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def central(parameters: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Mass, centre of mass and inertia about it (3, 3)."""
    centre = parameters[1:4] / parameters[0]
    about = _matrix(parameters) - parameters[0] * ((centre @ centre) * np.eye(3) - np.outer(centre, centre))
    return float(parameters[0]), centre, about


def parameters_of(plant: MultibodyPlant, link: str) -> tuple[FloatArray, FloatArray]:
    """(10,) of a link of a finalized plant, and (10,) of the link with all that is welded to it."""
    body, context = plant.GetBodyByName(link), plant.CreateDefaultContext()
    welded = [each.index() for each in plant.GetBodiesWeldedTo(body)]
    found = [plant.CalcSpatialInertia(context, body.body_frame(), each) for each in ([body.index()], welded)]
    return _parameters(found[0]), _parameters(found[1])


def _parameters(spatial: Any) -> FloatArray:
    mass = spatial.get_mass()
    inertia = np.asarray(spatial.CalcRotationalInertia().CopyToFullMatrix3())
    return np.array([mass, *(mass * np.asarray(spatial.get_com())), *inertia[np.triu_indices(3)]])


def change_urdf(root: ET.Element, changes: LinkChanges) -> None:
    """Put what was found into the links of a URDF without meshes.

    Raises:
        ParamsError: a link that is not there, or parameters that cannot be.
    """
    if not changes.links:
        return
    plant: Any = MultibodyPlant(1e-3)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)  # joints may follow others
    Parser(plant).AddModelsFromString(ET.tostring(root, encoding="unicode"), "urdf")
    plant.Finalize()
    tags = {str(link.get("name")): link for link in root.findall("link")}
    for link in changes.links:
        if link not in tags:
            raise ParamsError(f"{changes.source}: no link {link!r} in the robot{did_you_mean(link, tuple(tags))}")
        own, whole = parameters_of(plant, link)
        _write(tags[link], consistent(own + changes.applied(link, whole) - whole))


def _write(link: ET.Element, parameters: FloatArray) -> None:
    for old in link.findall("inertial"):
        link.remove(old)
    mass, centre, about = central(parameters)
    made = ET.SubElement(link, "inertial")
    ET.SubElement(made, "origin", {"xyz": " ".join(map(repr, centre.tolist())), "rpy": "0 0 0"})
    ET.SubElement(made, "mass", {"value": repr(mass)})
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    ET.SubElement(made, "inertia", {n: repr(v) for n, v in zip(names, about[np.triu_indices(3)].tolist(), strict=True)})
