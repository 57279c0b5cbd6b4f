"""What `close-loop` knows of a joint when it is done; plain data, read by the report and written to report.json."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

from drake_tc.actuation.model import ActuatorModel
from drake_tc.config.joint_units import TURNING, JointUnits
from drake_tc.diagnosis.notes import Note
from drake_tc.diagnosis.problem.parameters import Correlation, Estimate, PlausibleRange
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.residual.remainder import FoundRemainder
from drake_tc.diagnosis.residual.unexplained import DataSplit, NextExperiment, SharedBand, Unexplained, Verdict
from drake_tc.effects.base import DriveKind
from drake_tc.effects.unknown_load import UnknownLoadEffect
from drake_tc.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

RefinementStatus = Literal[
    "accepted", "no_gain", "worse_held_out", "implausible", "resolved", "nothing_to_simulate", "nothing_to_refine"
]
"""Why the refined model stands or does not, as a word."""
Withdrawal = Literal["noise_of_one_channel", "worse_on_held_out", "below_floor"]
"""Why: only the noise of one channel asks for it; it lowers the predictive density of the held-out runs; it contributes
less than `priors.NAMED_FLOORS` noise floors."""
INTERVAL_COLUMNS = ("effect", "parameter", "value", "low", "high", "unit")
"""Of `JointResult.intervals`."""
Rejection = Literal["too_little_evidence", "not_possible", "cannot_be_looked_for", "not_recorded", "not_excited"]
"""Why an effect was tried and not added, or could not be tried (`drake_tc.effects.context.Obstacle`)."""


@dataclass(frozen=True)
class RefinedParameter:
    """One number before and after: effect key ("drive" for the gain), name, unit, and whether it rests on a bound."""

    key: str
    name: str
    unit: str
    equation_error: float
    output_error: float
    at_bound: bool


@dataclass(frozen=True)
class Refinement:
    """Output error on the training runs.

    Attributes:
        status: Accepted, or why not.
        why: For "implausible", the effect library's own sentence on values, law and source; "" otherwise.
        model: The refined model; None unless accepted.
        parameters: Numbers that the search was free to change; empty where there was no search.
        train: (model after, refined) mean absolute position error of the free runs of the training runs [rad].
        cross_validated: The same on stretches of runs that were left out in turn.
        error_train, error_heldout: RMS of the model equation under the refined numbers [effort], with the drive gain of
            the model after; None where it cannot be computed.
        free_run_heldout: RMS of the position error of its free runs on the held-out runs [rad]; None without any.
    """

    status: RefinementStatus
    why: str = ""
    model: ActuatorModel | None = None
    parameters: tuple[RefinedParameter, ...] = ()
    train: tuple[float, float] | None = None
    cross_validated: tuple[float, float] | None = None
    error_train: float | None = None
    error_heldout: float | None = None
    free_run_heldout: float | None = None

    @property
    def accepted(self) -> bool:
        """Whether there is a refined model."""
        return self.model is not None


def named_values(model: ActuatorModel) -> Mapping[str, Mapping[str, float]]:
    """Numbers by effect key, with the gain of the drive under "drive"."""
    return {"drive": {"gain": model.drive.gain}, **{v.key: dict(v.parameters) for v in model.effects}}


@dataclass(frozen=True)
class DidNotHold:
    """An effect that the training runs chose and that is not believed.

    Attributes:
        key, id, title: Of the effect. reason: why not.
    """

    key: str
    id: str
    title: str
    reason: Withdrawal


class Shown:
    """A result: its `repr` is what the command prints, and a notebook shows the residual of each joint too."""

    def __repr__(self) -> str:
        return str(_render("summary", "result_text", self))

    def _repr_html_(self) -> str:
        return str(_render("summary", "result_html", self))


def _render(module: str, name: str, found: object) -> Any:
    return getattr(import_module(f"drake_tc.report.{module}"), name)(found)


@dataclass(frozen=True)
class Errors:
    """RMS of the model equation [effort] on rows in motion, and of the free-running diagram's position [rad]."""

    train: float
    heldout: float
    free_run_heldout: float | None


@dataclass(frozen=True)
class RunErrors:
    """Errors of the model equation on one run [effort].

    Attributes:
        run: Name. heldout: whether it took no part in fitting. rows: number of rows.
        before, after: RMS. mean_absolute_before, mean_absolute_after: mean absolute error.
    """

    run: str
    heldout: bool
    rows: int
    before: float
    after: float
    mean_absolute_before: float
    mean_absolute_after: float


@dataclass(frozen=True)
class FoundEffect:
    """An effect that the model lacked.

    Attributes:
        heldout_gain: 1 - held-out error with it / without it (the other effects refitted).
        stability: Posterior probability of the set with it, against the same set without it.
        contribution: RMS of what it adds, on held-out rows [effort].
        robot_gain: Of a robot: 1 - held-out error of all joints with it / without it, each joint weighted by its noise,
            which compares with `SharedEffect.heldout_gain`. None for joints whose loads are measured.
    """

    key: str
    id: str
    title: str
    parameters: Mapping[str, Estimate]
    heldout_gain: float
    stability: float
    contribution: float
    robot_gain: float | None = None


@dataclass(frozen=True)
class RejectedEffect:
    """An effect that was tried on top of the final model and not added, or that could not be tried.

    Attributes:
        key, id: Of the effect.
        reason: As a word.
        obstacle: Why it could not be tried, or why its fitted value is not possible, in the words of the effect library
            (`Obstacle.statement`, `effects.check.implausible`). "" where it has too little evidence, or where the drive
            gain would be 0.
        log_odds: Of the set with it over the set without it, at equal noise; 0 where it was not tried.
        heldout_gain: 1 - held-out error with it / without it; 0 where it was not tried.
    """

    key: str
    id: str
    reason: Rejection
    obstacle: str = ""
    log_odds: float = 0.0
    heldout_gain: float = 0.0


@dataclass(frozen=True, repr=False)
class JointResult(Shown):
    """One joint's diagnosis. Its `repr` is the verdict and a table; a notebook shows the residual too.

    `plausible` has the possible range of each parameter of the final model, by effect key and name. `load_notes` say
    what an unknown load, and the drive's declared scale and damping, mean for this result; they are among the `notes`
    too. `set_up_wrong`: no effects were looked for, because errors of the robot's set-up were found. `links_fitted`:
    the robot's links were fitted at the declared drive gains. `free_run` holds, by held-out run, time, recorded
    position and the free runs "before", "after" and, where the refinement was accepted, "refined". `unit` is that of
    the effort, `units` are those of the joint's other quantities. `run_spread`: standard deviation of each friction
    from run to run over its mean. `remainder`: the smooth part of what is left, of a joint whose verdict is
    `unexplained_structure`.
    """

    joint: str
    drive: DriveKind
    unit: str
    baseline: Fit
    final: Fit
    baseline_parameters: Mapping[str, Mapping[str, Estimate]]
    final_parameters: Mapping[str, Mapping[str, Estimate]]
    noise_floor: float
    before: Errors
    after: Errors
    effects: tuple[FoundEffect, ...]
    rejected: tuple[RejectedEffect, ...]
    indistinguishable: tuple[tuple[str, str], ...]
    next_experiment: NextExperiment | None
    unexplained: Unexplained
    verdict: Verdict
    train: DataSplit
    heldout: DataSplit
    did_not_hold: tuple[DidNotHold, ...] = ()
    runs: tuple[RunErrors, ...] = ()
    plausible: Mapping[str, Mapping[str, PlausibleRange]] = field(default_factory=dict)
    shared_band: SharedBand | None = None
    free_run: Mapping[str, Mapping[str, FloatArray]] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()
    load_notes: tuple[Note, ...] = ()
    refinement: Refinement | None = None
    set_up_wrong: bool = False
    links_fitted: bool = False
    units: JointUnits = TURNING
    held: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    correlation: Correlation | None = None
    run_spread: float = 0.0
    remainder: FoundRemainder | None = None

    @property
    def model(self) -> ActuatorModel:
        """The model after, as model_after.yaml holds it."""
        from drake_tc.diagnosis.result.models import model_of

        return model_of(self, final=True)

    @property
    def model_before(self) -> ActuatorModel:
        """The declared model with its fitted parameters, as model_before.yaml holds it."""
        from drake_tc.diagnosis.result.models import model_of

        return model_of(self, final=False)

    @property
    def intervals(self) -> "pd.DataFrame":
        """One row a parameter of the final model: effect, parameter, value, ends of its 95 % interval, unit.

        An end is infinite where the logs do not limit the parameter on that side.
        """
        import pandas as pd

        rows = [
            (key, name, estimate.value, *estimate.ci95, estimate.unit)
            for key, group in self.final_parameters.items()
            for name, estimate in group.items()
        ]
        return pd.DataFrame(rows, columns=list(INTERVAL_COLUMNS))

    def plot_residual(self) -> "Figure":
        """Measured and modelled effort on the held-out runs, and the residuals before and after, over time."""
        figure: Figure = _render("plots.time_plots", "residual_figure", self)
        return figure

    @property
    def load(self) -> tuple[str, Mapping[str, Estimate]] | None:
        """(title, parameters) of an unknown load as the final model has it; None where the load is known."""
        keys = {t.effect.key: t.effect.title for t in self.final.terms if isinstance(t.effect, UnknownLoadEffect)}
        return next(((title, self.final_parameters[key]) for key, title in keys.items()), None)

    @property
    def gain_identified(self) -> bool:
        """Whether the interval of the drive gain is narrower than the gain itself."""
        gain = self.final_parameters["drive"]["gain"]
        return gain.ci95[1] - gain.ci95[0] < abs(gain.value)
