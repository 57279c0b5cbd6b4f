"""The causes that no single joint owns: which ones a robot can have, their parameters and their columns over runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from drake_tc.diagnosis.shared.body_motion import Structure, joint_is_prismatic
from drake_tc.diagnosis.shared.cause_columns import alignment_columns, gain_columns
from drake_tc.estimation.robot_loads import RobotLogs
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.rig import Rig
from drake_tc.robot.rigid_regressor import LINK_PARAMETERS, UNITS, link_model
from drake_tc.types import BoolArray, FloatArray

GRID_SECONDS = 0.01
"""Columns of motion that has passed filters of nine times that width are computed this often and interpolated."""
TITLES: Mapping[str, str] = {
    "link_mass": "mass of a link",
    "link_com": "centre of mass of a link",
    "encoder_offset": "encoder offset",
    "payload": "payload",
    "ft_bias": "bias of an F/T sensor",
    "ft_gain": "gain of an F/T sensor",
    "imu_bias": "bias of the IMU",
}
"""Causes that may be reported. Others are estimated along within their tolerances and never reported."""
AXES = ("x", "y", "z")
LINK_PARAMETERS_ID = "link_parameters"
"""All ten of a link whose parameters are fitted; never reported as a cause."""
PAYLOAD_ID = "payload_parameters"
"""All ten of what a link carries in one run; never reported as a cause."""
LINK_INERTIA_ID = "link_inertia"
"""Six moments of inertia of a link whose mass or centre is asked for; never reported as a cause."""
HEAVIEST = 10.0
"""Error of a link's mass, over the mass of all links, at most: what is larger is an error of a unit."""
FARTHEST = 1.0
"""Of a link's centre of mass from where the robot's file has it, and of a payload's from the link's origin [m]."""
INERTIA_TOLERANCE = 0.2
"""Of a link's moments of inertia where its mass or centre is wrong, over those of its mass at its size."""


@dataclass(frozen=True)
class Cause:
    """One cause.

    Attributes:
        id: As in `TITLES`.
        where: Link, sensor or joint.
        parameters: Names. units: of each.
        columns: Its places among all columns.
        tolerance: (p,) standard deviations that its sensor's data sheet or owner gives the parameters; empty where
            nothing is known of them (a link's mass).
        prior: (p,) standard deviations that the inertias of a link have whose mass or centre is asked for.
        possible: Smallest and largest value that each of the reported parameters can have.
    """

    id: str
    where: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    columns: slice
    tolerance: tuple[float, ...] = ()
    prior: tuple[float, ...] = ()
    possible: tuple[float, float] = (-np.inf, np.inf)

    @property
    def key(self) -> str:
        """`id` and `where` in one word."""
        return f"{self.id}@{self.where}"

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    def physical(self, delta: FloatArray) -> FloatArray:
        """Reported parameters from delta (p,): what the sensor adds, or what the model lacks."""
        if self.id in ("link_mass", "link_com", "payload", LINK_PARAMETERS_ID, PAYLOAD_ID):
            return np.asarray(-delta)
        if self.id in ("ft_gain", "imu_gain"):
            return np.asarray(delta / (1.0 - delta))
        return np.asarray(delta)


@dataclass(frozen=True, eq=False)
class Piece:
    """Columns over one stretch of a run: time (G,) since the start of the run [s] and values (G, n, P).

    Of F/T sensors also the time (T,) and the wrenches (T, 6k) from which the torques were computed. Gains and
    alignments scale and turn these readings themselves: a coarser grid would leave what a contact changes faster.
    """

    time: FloatArray
    values: FloatArray
    read_at: FloatArray = field(default_factory=lambda: np.zeros(0))
    wrenches: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True, eq=False)
class CauseColumns:
    """All causes' columns over a set of runs.

    Attributes:
        causes: In the order of the columns.
        joints: Of the columns, n.
        pieces: By run name.
    """

    causes: tuple[Cause, ...]
    joints: tuple[str, ...]
    pieces: Mapping[str, tuple[Piece, ...]]

    def of(self, run: str, joint: str, time: FloatArray) -> FloatArray:
        """(T, P) at times since the start of a run [s]; 0 outside its usable stretches."""
        j = self.joints.index(joint)
        width = self.causes[-1].columns.stop
        out = np.zeros((time.size, width))
        for piece in self.pieces[run]:
            inside = (time >= piece.time[0] - 1e-9) & (time <= piece.time[-1] + GRID_SECONDS)
            for column in range(width):
                out[inside, column] = np.interp(time[inside], piece.time, piece.values[:, j, column])
            self._scale_readings(out, inside, piece, time)
        return out

    def _scale_readings(self, out: FloatArray, inside: BoolArray, piece: Piece, time: FloatArray) -> None:
        """Fill in the columns of gains and alignments of F/T sensors, whose biases' columns (T, 6) are there."""
        known = {(c.id, c.where): c.columns for c in self.causes}
        mounts = [where for name, where in known if name == "ft_bias"]
        for k, where in enumerate(mounts):
            wrench = piece.wrenches[:, 6 * k : 6 * k + 6]
            read = np.stack([np.interp(time[inside], piece.read_at, axis) for axis in wrench.T], axis=1)
            bias = out[inside, known["ft_bias", where]][:, None, :]
            out[inside, known["ft_gain", where]] = gain_columns(bias, read)[:, 0]
            out[inside, known["ft_alignment", where]] = alignment_columns(bias, read)[:, 0]


def list_causes(logs: RobotLogs, structure: Structure, rig: Rig) -> tuple[Cause, ...]:
    """Every cause that this robot's torques can have, with the rig's tolerances."""
    found: list[Cause] = []

    def add(
        name: str,
        where: str,
        parts: Sequence[tuple[str, str]],
        tolerance: Sequence[float] = (),
        **more: Any,
    ) -> None:
        first = found[-1].columns.stop if found else 0
        names, units = zip(*parts, strict=True)
        found.append(Cause(name, where, names, units, slice(first, first + len(parts)), tuple(tolerance), **more))

    load, ten = next(iter(rig.load.values())), list(zip(LINK_PARAMETERS, UNITS, strict=True))
    if logs.links is not None and isinstance(load, RobotLoad):
        spread = logs.links.deviations(load.tolerance).reshape(-1, len(UNITS))
        for name, each in zip(logs.links.tree.links, spread, strict=True):
            add(LINK_PARAMETERS_ID, name, ten, each.tolist())
        for run in load.payload:
            add(PAYLOAD_ID, run, ten, logs.links.payload_deviations.tolist())
        return tuple(found)
    heaviest = HEAVIEST * sum(link.mass for link in structure.links)
    for link in structure.links:
        add("link_mass", link.name, [("mass", "kg")], possible=(-link.mass, heaviest))
    for link in structure.links:
        add("link_com", link.name, [(f"com_{a}", "m") for a in AXES], possible=(-FARTHEST, FARTHEST))
    if encoders_alone(logs):
        for joint, slides in zip(logs.robot.joints, joint_is_prismatic(logs.model), strict=True):
            offset = rig.joint_sensors(joint).encoder_offset
            add("encoder_offset", joint, [("offset", "m" if slides else "rad")], [offset] if offset else ())
        links = link_model(logs.robot)
        for carrier in links.outermost:
            add("payload", carrier, ten)
        spread = links.deviations(INERTIA_TOLERANCE).reshape(-1, len(UNITS))[:, 4:]
        for name, each in zip(links.tree.links, spread, strict=True):
            add(LINK_INERTIA_ID, name, ten[4:], prior=tuple(each.tolist()))
    turns = [(f"turn_{a}", "rad") for a in AXES]
    for mount in logs.robot.force_torque:
        known = rig.force_torque_tolerance(mount.name)
        biases = [(f"force_{a}", "N") for a in AXES] + [(f"torque_{a}", "N*m") for a in AXES]
        add("ft_bias", mount.name, biases, [known.force_bias] * 3 + [known.torque_bias] * 3)
        add("ft_gain", mount.name, [("force", "-"), ("torque", "-")], [known.gain] * 2)
        add("ft_alignment", mount.name, turns, [known.alignment] * 3)
    if logs.reads_imu:
        name = logs.robot.imu[0].name
        imu = rig.imu_tolerance(name)
        biases = [(f"accel_{a}", "m/s^2") for a in AXES] + [(f"gyro_{a}", "rad/s") for a in AXES]
        add("imu_bias", name, biases, [imu.accel_bias] * 3 + [imu.gyro_bias] * 3)
        add("imu_gain", name, [("accel", "-")], [imu.gain])
        add("imu_alignment", name, turns, [imu.alignment] * 3)
    return tuple(found)


def encoders_alone(logs: RobotLogs) -> bool:
    """Whether the loads are made of the joints' positions alone: other sensors would show a wrong encoder too."""
    return logs.robot.fixed_base and not logs.reads_imu and not logs.robot.force_torque
