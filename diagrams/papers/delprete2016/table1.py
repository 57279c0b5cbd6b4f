"""Del Prete et al. (2016), Table 1.

K_tau and K_v of the leg's drives, identified from simulated logs; and the hidden effects found.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from scipy.stats import norm

from drake_tc.actuation.model import ActuatorModel
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagrams.papers.delprete2016.complete_model import (
    CALIBRATION,
    DriveEstimate,
    control,
    diagnose,
    drive_estimates,
    read_logs,
)
from drake_tc.diagrams.papers.delprete2016.identification import Experiment, linear_models, record_experiment
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.types import TextTable

HIDDEN = ("deadzone", "velocity_sign_switch")
RECORDING = 0.18
"""Share of the whole work."""
FAMILY = 12
NOTES = (
    "Simulated: realistic sensors, torques estimated off line (41-sample windows, F/T bias taken off). The complete"
    " model is declared (viscous, Coulomb, dead zone, velocity-sign switch, rotor inertia), all values unknown.",
    "Of K_tau the samples tell the scatter alone; the F/T sensors' scale"
    f" (tolerance {100 * CALIBRATION:g} %, simulated at its limit) shifts it as a whole, and no log of the same sensors"
    " can tell. Both intervals are counted, and a control has the scale undone; what is left there is the torque"
    " estimate's own error.",
    "The rotor inertia is fitted as the sampled simulation adds b h/2 to it, because friction acts at the end of a"
    " step h; held at its known value, it would bias K_tau.",
    "Symmetric and asymmetric: two columns alone, on growing sinusoids and pushes at rest, as in the paper. The"
    " three-line fit of its section 3.2 does not come to rest on these logs for most joints, as in the paper.",
)


@dataclass(frozen=True, eq=False)
class Table1:
    """What was identified.

    Attributes:
        experiment: What was recorded; its files are gone.
        drives: K_tau and K_v of every joint, complete model declared.
        unscaled: The same from logs whose F/T sensors have no scale error.
        complete: Joint to its diagnosis with the complete model declared.
        hidden: Effect that was not declared, to joint, to diagnosis.
        linear: Penalty to the paper's two-column models.
    """

    experiment: Experiment
    drives: tuple[DriveEstimate, ...]
    unscaled: tuple[DriveEstimate, ...]
    complete: Mapping[str, JointResult]
    hidden: Mapping[str, Mapping[str, JointResult]]
    linear: Mapping[str, Mapping[str, ActuatorModel]]

    @property
    def joints(self) -> tuple[str, ...]:
        """Those identified."""
        return tuple(self.complete)


def identify_table1(
    seed: int = 0,
    progress: Progress | None = None,
    joints: Sequence[str] | None = None,
    hidden: Sequence[str] = HIDDEN,
) -> Table1:
    """Record the experiment, identify the complete model, and have each hidden effect looked for.

    Args:
        seed: Of the sensors' noise and of the resampling.
        progress: Told what is done.
        joints: Only these; None: all.
        hidden: Effects not to declare, one at a time.

    Raises:
        DrakeTcError: see `record_experiment` and `diagnose`.
    """
    with TemporaryDirectory() as folder:
        recorded = (lambda text, share: progress(text, RECORDING * share)) if progress else None
        experiment = record_experiment(Path(folder), recorded, seed)
        logs = read_logs(experiment)
        chosen = experiment.joints if joints is None else tuple(joints)
        cases: tuple[str | None, ...] = (None, *hidden)
        found: dict[str | None, dict[str, JointResult]] = {case: {} for case in cases}
        steps = [(case, joint) for case in cases for joint in chosen]
        for number, (case, joint) in enumerate(steps):
            if progress:
                what = "complete model" if case is None else f"{case} not declared"
                progress(f"{joint}, {what}", RECORDING + (1.0 - RECORDING) * number / len(steps))
            found[case][joint] = diagnose(logs, joint, case, seed)
        drives = tuple(e for result in found[None].values() for e in drive_estimates(result, logs))
        unscaled = tuple(e for joint in chosen for e in drive_estimates(control(logs, joint), logs))
        linear = {penalty: linear_models(experiment, penalty) for penalty in ("symmetric", "asymmetric")}
    return Table1(experiment, drives, unscaled, found[None], {case: found[case] for case in hidden}, linear)


def table1(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """Table 1 anew."""
    data = identify_table1(seed, progress)
    rows = evaluated(figures(data), expectations("a_table1"))
    tables = (_drive_table(data), *(_hidden_table(data, effect) for effect in data.hidden))
    return Reproduction("A.table1", rows, tables, (*NOTES, *_more_notes(data)))


def family_factor(count: int = FAMILY) -> float:
    """How much wider intervals are that hold all together with 95 %: z(1 - 0.05/(2 count))/z(0.975)."""
    return float(norm.ppf(1.0 - 0.025 / count) / norm.ppf(0.975))


def figures(data: Table1) -> dict[str, float]:
    """The figures to judge, by name."""
    gains = [e for e in data.drives if e.name == "K_tau"]
    damping = [e for e in data.drives if e.name == "K_v"]
    wide = family_factor(len(data.drives))
    out = {
        "K_v within its 95 % interval, joints": float(sum(e.inside() for e in damping)),
        "K_tau within its 95 % interval and F/T tolerance, joints": float(sum(e.inside() for e in gains)),
        "K_tau within its 95 % interval alone, joints": float(sum(e.inside(calibrated=True) for e in gains)),
        "the same with the F/T sensors' scale undone, joints": float(
            sum(e.inside(calibrated=True) for e in data.unscaled if e.name == "K_tau")
        ),
        "largest error of K_tau with the F/T sensors' scale undone": 100.0
        * max(abs(e.error) for e in data.unscaled if e.name == "K_tau"),
        "K_tau and K_v within family-wise intervals, of 12": float(sum(e.inside(wide) for e in data.drives)),
        "largest error of K_tau": 100.0 * max(abs(e.error) for e in gains),
        "largest error of K_v": 100.0 * max(abs(e.error) for e in damping),
        "largest RMS error of the torque estimate": 100.0 * max(data.experiment.torque_share.values()),
        "joints that lack nothing to close-loop": float(sum(not r.effects for r in data.complete.values())),
    }
    for effect, results in data.hidden.items():
        pairs = results.values()
        out[f"{effect} found when not declared, joints"] = float(sum(_found(r, effect) for r in pairs))
        out[f"{effect} found and nothing else, joints"] = float(
            sum(_found(r, effect) and len(r.effects) == 1 for r in pairs)
        )
        out[f"held-out error after/before with {effect}, worst joint"] = max(
            r.after.heldout / r.before.heldout for r in pairs
        )
    return out


def _found(result: JointResult, effect: str) -> bool:
    return effect in {found.key for found in result.effects}


def _drive_table(data: Table1) -> TextTable:
    """10^3 K_tau and 10^3 K_v, as the paper prints them."""
    rows = []
    for e in data.drives:
        linear = [_coefficient(models[e.joint], e.name) for models in data.linear.values()]
        total = e.half + e.tolerance
        rows.append(
            (
                f"{e.joint} {e.name}",
                *(f"{1e3 * value:.5g}" for value in (e.truth, e.value)),
                *(f"{1e3 * value:.2g}" for value in (e.half, total)),
                "yes" if e.inside(calibrated=True) else "no",
                "yes" if e.inside() else "no",
                *(f"{1e3 * value:.4g}" for value in linear),
            )
        )
    headings = ("10^3", "Table 1", "identified", "95 % +/-", "with F/T tolerance", "inside", "inside with tolerance")
    title = "K_tau [10^-3 rad/(N m)] and K_v [10^-3 rad/(rad/s)]"
    return TextTable(title, (*headings, *data.linear), tuple(rows))


def _coefficient(model: ActuatorModel, name: str) -> float:
    gain = model.drive.gain
    return gain if name == "K_tau" else gain * model.effects[0].parameters["viscous"]


def _hidden_table(data: Table1, effect: str) -> TextTable:
    """What was found where `effect` was not declared."""
    rows = []
    for joint, result in data.hidden[effect].items():
        truth = next(e for e in data.experiment.truth[joint].effects if e.key == effect)
        (name, true), *_ = truth.parameters.items()
        estimate = next((f.parameters[name] for f in result.effects if f.key == effect), None)
        interval = "-" if estimate is None else f"[{estimate.ci95[0]:.4g}, {estimate.ci95[1]:.4g}]"
        rows.append(
            (
                joint,
                f"{true:.4g}",
                "-" if estimate is None else f"{estimate.value:.4g}",
                interval,
                f"{1e3 * result.before.heldout:.4f}",
                f"{1e3 * result.after.heldout:.4f}",
                ", ".join(f.key for f in result.effects) or "nothing",
            )
        )
    headings = ("joint", "simulated", "found", "95 %", "held-out before", "after [10^-3 rad]", "close-loop added")
    return TextTable(f"{effect} not declared", headings, tuple(rows))


def _more_notes(data: Table1) -> tuple[str, ...]:
    """What intervals of a family mean, and what `close-loop` adds although nothing is missing."""
    family = (
        f"{FAMILY} intervals at 95 %: the chance that all hold is {0.95**FAMILY:.0%}. Family-wise intervals"
        f" (Bonferroni) are {family_factor():.2f} times wider."
    )
    return family, *(
        f"{joint}: all declared, close-loop still adds {', '.join(f.key for f in result.effects)}; held-out error"
        f" {1e3 * result.before.heldout:.4f} -> {1e3 * result.after.heldout:.4f} 10^-3 rad: not a real effect."
        for joint, result in data.complete.items()
        if result.effects
    )
