"""The causes that no single joint owns: their names, parameters and tolerances, and their columns over runs."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from drake_tc.diagnosis.problem.shared.cause_columns import alignment_columns, gain_columns
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
        prior: (p,) standard deviations that the parameters keep where the cause is found; empty where they have none.
        special: Keys of causes that are special cases of this one.
        possible: Smallest and largest value that each of the reported parameters can have.
    """

    id: str
    where: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    columns: slice
    tolerance: tuple[float, ...] = ()
    prior: tuple[float, ...] = ()
    special: frozenset[str] = frozenset()
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
