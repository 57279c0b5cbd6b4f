"""What is told of a robot: its joints, the causes that no single joint owns, and the links that were fitted."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.diagnose import asked_of, joint_result
from drake_tc.diagnosis.intervals import CRITICAL, parameters_of
from drake_tc.diagnosis.problem.parameters import Estimate, widened
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.errors import robot_gains, run_errors
from drake_tc.diagnosis.result.joint_result import Errors, JointResult
from drake_tc.diagnosis.result.links import SEEN, FittedLinks, LinkPosterior, body_parameters, links_of
from drake_tc.diagnosis.result.rig_result import SetUpCheck, SharedEffect
from drake_tc.diagnosis.robot.causes import NAMES, Causes, Named
from drake_tc.diagnosis.robot.joints import RobotFit, RobotJoint
from drake_tc.diagnosis.robot.runs import ALL_JOINTS
from drake_tc.diagnosis.shared.causes import Cause
from drake_tc.estimation.robot_loads import RobotLogs
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.robot.rigid_regressor import LinkModel
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class RobotResult:
    """What was found on a robot.

    Attributes:
        joints: By name; errors and models "before" are those of loads without the sensors' errors within tolerance.
        shared: Causes that no single joint owns, by held-out gain.
        held: Held-out runs with the loads of the model before.
        held_after: The same without the shared causes. train_after: training runs without them.
        robot_gains: (joint, effect key) to the effect's held-out gain of the whole robot, which compares with
            `SharedEffect.heldout_gain`.
        links: The links' parameters where they were fitted.
        set_up: Of a robot with a fixed base, where the declared model leaves much of an effort.
    """

    joints: Mapping[str, JointResult]
    shared: tuple[SharedEffect, ...]
    held: Sequence[Run] = field(default=())
    held_after: Sequence[Run] = field(default=())
    train_after: Sequence[Run] = field(default=())
    robot_gains: Mapping[tuple[str, str], float] = field(default_factory=dict)
    links: FittedLinks | None = None
    set_up: SetUpCheck | None = None


def robot_result(
    logs: RobotLogs,
    before: RobotFit,
    fit: RobotFit,
    named: Named,
    causes: Causes,
    set_up: SetUpCheck | None,
    executor: Executor | None,
    moved: float = 0.0,
) -> RobotResult:
    """The result of a robot.

    Args:
        logs: The robot.
        before: All joints with their declared models.
        fit: All joints after their searches.
        named: Causes that no single joint owns.
        causes: All of them.
        set_up: What the runs say against the set-up.
        executor: Assesses what is left in its workers; None does it here.
        moved: By how much the readings of a late encoder were moved in time [s].
    """
    runs = fit.runs
    joints = {}
    for name, joint in fit.joints.items():
        if joint.decision is None:
            raise AssertionError(name)
        asked = asked_of(joint.prepared, runs.options)
        made = joint_result(joint.decision, asked, runs.rig, name, runs.options, executor=executor)
        joints[name] = _with_baseline(made, before.joints[name]) if fit.shared.places.size else made
        joints[name] = replace(joints[name], links_fitted=logs.links is not None)
        if name in runs.rig.drive_gain:
            joints[name] = _with_uncertain_gain(joints[name], _gain_tolerance(runs.rig))
    train_after, held_after = runs.at(fit.moved())
    sigma = {n: rms(j.evidence.residual(j.evidence.model.train, j.best)) / j.best.b[0] for n, j in fit.joints.items()}
    return RobotResult(
        joints=joints,
        shared=shared_effects(fit, before, named, causes, moved),
        held=runs.at(before.moved())[1],
        held_after=held_after,
        train_after=train_after,
        robot_gains=robot_gains(joints, sigma),
        links=None if logs.links is None else _links(logs.links, fit, _gain_tolerance(runs.rig)),
        set_up=set_up,
    )


def _gain_tolerance(rig: Rig) -> float:
    """Standard deviation of the common relative error of the declared drive gains."""
    load = next(iter(rig.load.values()))
    return load.gain_tolerance if isinstance(load, RobotLoad) else 0.0


def _with_uncertain_gain(result: JointResult, tolerance: float) -> JointResult:
    """The joint's result with intervals that know how far its declared gain, and all torques with it, may be off."""
    beta = result.final.beta
    final = widened(result.final_parameters, result.final, tolerance**2 * np.outer(beta, beta))
    effects = tuple(replace(e, parameters=final[e.key]) for e in result.effects)
    return replace(result, final_parameters=final, effects=effects)


def _with_baseline(result: JointResult, before: RobotJoint) -> JointResult:
    """The joint's result with the declared model, and its errors, on the loads of the model before."""
    evidence, scored = before.evidence, before.best
    sides = []
    for split, after in ((evidence.model.train, result.train), (evidence.model.held, result.heldout)):
        residual = evidence.residual(split, scored)
        sides.append(
            DataSplit(after.samples, residual if residual.size == after.after.size else after.before, after.after)
        )
    left = [rms(side.before) for side in sides]
    return replace(
        result,
        baseline=Fit(scored.terms, scored.beta, sides[0].before, left[0], left[0], np.zeros(1)),
        baseline_parameters=parameters_of(evidence, scored),
        before=Errors(left[0], left[1], result.before.free_run_heldout),
        train=sides[0],
        heldout=sides[1],
        runs=tuple(run_errors((sides[0], sides[1]))),
    )


def shared_effects(
    fit: RobotFit, before: RobotFit, named: Named, causes: Causes, moved: float
) -> tuple[SharedEffect, ...]:
    """The causes found, by held-out gain; `moved` is that part of an encoder's delay which the runs lack already."""
    out = []
    for cause in named.causes:
        late = moved if cause.id == "delay" and cause.where != ALL_JOINTS else 0.0
        if cause.id == "delay" and late + _of(fit, cause)[0][0] <= 0.0:
            continue  # efforts that are recorded late are no effect
        rest = [c for c in named.causes if c is not cause]
        gain, by_joint = held_out_gain(fit, causes, named.causes, rest) if not late else _held_out(fit, before)
        odds = causes.log_odds(fit, named.causes) - causes.log_odds(fit, rest)
        out.append(
            SharedEffect(
                id=cause.id,
                where=cause.where,
                title=_title(cause),
                parameters=_shifted(_parameters(fit, cause), late),
                heldout_gain=gain,
                stability=float(1.0 / (1.0 + np.exp(-np.clip(odds, -50.0, 50.0)))),
                joints=by_joint,
                indistinguishable=tuple((c.id, c.where) for c in named.alternatives.get(cause.key, ())),
            )
        )
    return tuple(sorted(out, key=lambda e: -e.heldout_gain))


def _shifted(parameters: dict[str, Estimate], by: float) -> dict[str, Estimate]:
    return {
        name: replace(e, value=e.value + by, ci95=(e.ci95[0] + by, e.ci95[1] + by)) for name, e in parameters.items()
    }


def _held_out(fit: RobotFit, before: RobotFit) -> tuple[float, dict[str, float]]:
    """Gain of all joints together, and by joint, against the declared models on other runs."""
    sides = [
        {n: j.evidence.residual(j.evidence.model.held, j.best) for n, j in each.joints.items()}
        for each in (fit, before)
    ]
    by_joint = {name: 1.0 - rms(sides[0][name]) / max(rms(sides[1][name]), 1e-300) for name in fit.joints}
    total = [sum(rms(side[n]) ** 2 / float(j.best.posterior.variance) for n, j in fit.joints.items()) for side in sides]
    return 1.0 - float(np.sqrt(total[0] / max(total[1], 1e-300))), by_joint


def _title(cause: Cause) -> str:
    if cause.id != "delay":
        return NAMES[cause.id]
    return "delay of all joints" if cause.where == ALL_JOINTS else "delay of the encoder"


def held_out_gain(
    fit: RobotFit, causes: Causes, larger: Sequence[Cause], smaller: Sequence[Cause]
) -> tuple[float, dict[str, float]]:
    """1 - held-out error with the larger set over that with the smaller one: of all joints, and by joint."""
    sides = [fit.held_out(causes.shared(each)) for each in (larger, smaller)]
    variance = {name: float(joint.best.posterior.variance) for name, joint in fit.joints.items()}
    total = [sum(float(r @ r) / variance[name] for name, r in side.items()) for side in sides]
    by_joint = {name: 1.0 - rms(sides[0][name]) / max(rms(sides[1][name]), 1e-300) for name in fit.joints}
    return 1.0 - float(np.sqrt(total[0] / max(total[1], 1e-300))), by_joint


def _of(fit: RobotFit, cause: Cause) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance of one cause's parameters; 0 of those that are not shared."""
    told, mean, spread = fit.belief(), np.zeros(fit.delta.size), np.zeros((fit.delta.size,) * 2)
    mean[fit.shared.places] = told.mean
    spread[np.ix_(fit.shared.places, fit.shared.places)] = told.covariance
    return mean[cause.columns], spread[cause.columns, cause.columns]


def _parameters(fit: RobotFit, cause: Cause) -> dict[str, Estimate]:
    """The cause's parameters with 95 % intervals."""
    delta, spread = _of(fit, cause)
    if cause.id == "payload":
        return body_parameters(-delta, spread, CRITICAL)
    half = CRITICAL * np.sqrt(np.maximum(np.diag(spread), 0.0))
    value, ends = cause.physical(delta), np.sort([cause.physical(delta - half), cause.physical(delta + half)], axis=0)
    return {
        name: Estimate(float(value[i]), unit, (float(ends[0, i]), float(ends[1, i])), False)
        for i, (name, unit) in enumerate(zip(cause.parameters, cause.units, strict=True))
    }


def _links(model: LinkModel, fit: RobotFit, gain_tolerance: float) -> FittedLinks:
    """The links' parameters as all joints together tell them."""
    told = fit.belief()
    seen = [joint.columns[0] for joint in fit.joints.values()]
    return links_of(
        model,
        fit.runs.every_cause,
        LinkPosterior(fit.shared.places, told.mean, told.covariance, fit.shared.deviation, CRITICAL, gain_tolerance),
        np.concatenate([c[:: max(1, len(c) // SEEN)] for c in seen]),
    )
