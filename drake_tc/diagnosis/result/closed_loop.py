"""What the closed loop makes of the models before and after; plain data, read by the report and report.json."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from drake_tc.types import FloatArray


@dataclass(frozen=True)
class LoopFigures:
    """One joint of the torque loop whose controller compensates one model; NaN or infinite where there is no figure.

    Attributes:
        rms_error, largest_error: Of q_d - q in the simulated motion [rad].
        spectral_radius: Of the joint's linear loop; below 1 it is stable.
        gain_margin: [-]. phase_margin: [rad]. delay_margin: [s]. sensitivity_peak: [-]. NaN where it is not stable.
    """

    rms_error: float
    largest_error: float
    spectral_radius: float
    gain_margin: float
    phase_margin: float
    delay_margin: float
    sensitivity_peak: float


@dataclass(frozen=True, eq=False)
class JointClosedLoop:
    """One joint's loop, the controller compensating the model before and the model after.

    Attributes:
        before, after: Figures.
        reference: (T,) q_d [rad]; it and the errors are empty where nothing was simulated.
        error_before, error_after: (T,) q_d - q [rad], NaN from where the joint ran away.
        changed: Whether the two models of this joint differ.
        gains: k6 [-], k7 [s], kp [-], the same in both.
    """

    before: LoopFigures
    after: LoopFigures
    reference: FloatArray
    error_before: FloatArray
    error_after: FloatArray
    changed: bool
    gains: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """The comparison: simulated, with the model after as the plant.

    Attributes:
        joints: By name; empty where the loop could not be made: the notes say why.
        plant: What was simulated, in words.
        controller: Filters and sensors, in words.
        run: Held-out run whose motion is the reference. start, end: of the stretch [s].
        time: (T,) of the traces [s].
        changed: Whether the models before and after differ in any joint.
        notes: What the reader must know.
        seconds: That it took.
    """

    joints: Mapping[str, JointClosedLoop]
    plant: str = ""
    controller: str = ""
    run: str = ""
    start: float = 0.0
    end: float = 0.0
    time: FloatArray | None = None
    changed: bool = False
    notes: tuple[str, ...] = field(default=())
    seconds: float = 0.0
