"""What the model is worth in use: in the closed loop and in another simulator; plain data, read by the report."""

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


@dataclass(frozen=True)
class ExportErrors:
    """RMS errors of the free-running position of a joint in a run [rad]; None where nothing could run.

    Attributes:
        joint: Its name.
        run: Name of the run.
        model: Of the identified model, in Drake with all its effects.
        export: Of the exported terms in the target.
        original: Of what the user's file had, in the target.
    """

    joint: str
    run: str
    model: float | None
    export: float | None
    original: float | None = None


@dataclass(frozen=True)
class ExportTrial:
    """An export that was run on the held-out runs.

    Attributes:
        to: The target, as `drake-tc export --to` takes it.
        target: Its name for people.
        runner: What ran the export.
        model_file: The model that was exported.
        losses: What the target lacks, a sentence each.
        rows: One a joint and run.
    """

    to: str
    target: str
    runner: str
    model_file: str
    losses: tuple[str, ...]
    rows: tuple[ExportErrors, ...]
