"""A robot whose links' parameters are known: shared causes first, then each joint's own.

Before that, gross errors of the set-up are tried where the declared models leave much of an effort
(`diagnosis.set_up`). With such an error, no causes and no effects are looked for. This needs a robot with a fixed base
and no sensor but the encoders.

1. All joints together, with the declared models: which causes that no single joint owns are missing (`selection`).
   Errors of sensors within their tolerances are estimated along (`stacked`).
2. Each joint by itself, on loads without all of these (`diagnose_joint`).
3. The alternative: no shared cause, each joint left to explain its own part. It stands when all joints together fit
   better that way.
4. The shared causes anew, beside the effects that the joints were found to have: those no longer real go.
5. An error of a sensor beyond its tolerance that lowers the joints' errors by little, but certainly, beside all that.
6. Causes that do not lower the error of the held-out runs are left out, and steps 2 to 5 repeated.

The model before is that of step 1 with no cause named: its loads are those without the sensors' errors within
tolerance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.problem.shared.causes import Cause
from drake_tc.diagnosis.problem.shared.columns_of_runs import columns_over
from drake_tc.diagnosis.problem.shared.rows import JointRows, stack
from drake_tc.diagnosis.problem.shared.stacked import StackedFit, fit_stacked
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.set_up import SetUpCheck, is_wrong
from drake_tc.diagnosis.result.shared_effects import (
    both_sides,
    original_baseline,
    shared_effects,
)
from drake_tc.diagnosis.result.shared_uncertainty import with_shared_uncertainty, with_uncertain_gains
from drake_tc.diagnosis.result.widening import robot_gains
from drake_tc.diagnosis.robot.case import RobotCase, own_search
from drake_tc.diagnosis.robot.noisy_efforts import diagnosed_beside_noise, gains_to_hold
from drake_tc.diagnosis.robot.result import RobotResult
from drake_tc.diagnosis.selection.comparison import effective_samples
from drake_tc.diagnosis.selection.joint_problem import Search
from drake_tc.diagnosis.selection.shared import SharedSearch, active, search_shared, substituted
from drake_tc.diagnosis.set_up.find import check_set_up
from drake_tc.diagnosis.thresholds import BEYOND_TOLERANCE_BESIDE, NEAR_NOISE, SHARED, SearchThresholds
from drake_tc.estimation.robot_loads import RobotLogs
from drake_tc.logs.record import Run
from drake_tc.robot.link_parameters import link_model
from drake_tc.types import FloatArray

MOST_OFFSETS = 2
"""How often the columns of an encoder's offset are computed anew at the offset that was found."""


def diagnose_shared(case: RobotCase, logs: RobotLogs, shared_thresholds: SearchThresholds = SHARED) -> RobotResult:
    """Diagnose a robot whose links' parameters are known. Held-out runs choose nothing; they can withdraw a cause.

    Args:
        case: The robot's runs.
        logs: The robot.
        shared_thresholds: Of the shared causes.

    Raises:
        IdentificationError: a joint whose runs cannot identify even the declared model.
    """
    if _in_effort(case):
        case = case.with_hold(case.train)
    raw = case.prepared(case.train, case.held)
    set_up = _set_up(case, logs, raw)
    if is_wrong(set_up):
        case = replace(case, options=replace(case.options, effects=(), assess_residual=False))
    case, found = _at_its_offset(case, logs, raw, _search(case, raw, shared_thresholds), shared_thresholds)
    before = case.without(found.baseline)
    prepared = case.prepared(*before)
    if is_wrong(set_up) or (found.chosen and _evidence(case, prepared, found) <= 0.0):
        found = SharedSearch((), found.baseline, found.baseline, ())
    start = _Before(raw, prepared, found.baseline, before[1])
    result = _settled(case, start, found, shared_thresholds)
    if wrong := {(e.id, e.where) for e in result.shared if e.heldout_gain <= 0.0}:
        kept = [c for c in found.chosen if (c.id, c.where) not in wrong]
        result = _settled(case, start, _search(case, raw, shared_thresholds, among=kept), shared_thresholds)
    return replace(result, set_up=set_up)


def _set_up(case: RobotCase, logs: RobotLogs, raw: Mapping[str, Prepared]) -> SetUpCheck | None:
    """What the runs say against the set-up; None where this is not looked at or little of every effort is left."""
    if not logs.robot.fixed_base or logs.reads_imu or logs.robot.force_torque:
        return None
    left = {
        joint: fit(p.train, p.terms).cv_rms / max(float(np.std(p.train.effort(()))), 1e-300) for joint, p in raw.items()
    }
    return check_set_up(logs, link_model(logs.robot), case.train, case.held, case.rig, left)


@dataclass(frozen=True, eq=False)
class _Before:
    """The model before.

    Attributes:
        raw: Joints with loads as the robot's model gives them.
        prepared: The same without the sensors' errors within tolerance.
        fitted: All joints with no cause named. held: Held-out runs of its loads.
    """

    raw: Mapping[str, Prepared]
    prepared: Mapping[str, Prepared]
    fitted: StackedFit
    held: Sequence[Run]

    @property
    def floor(self) -> FloatArray:
        """(n,) noise floors [effort]."""
        return np.array([p.floor for p in self.raw.values()])


def _search(
    case: RobotCase, raw: Mapping[str, Prepared], thresholds: SearchThresholds, among: Sequence[Cause] | None = None
) -> SharedSearch:
    rows = _declared(case, raw)
    return search_shared(rows, case.causes.causes, np.array([p.floor for p in raw.values()]), thresholds, among)


def _declared(case: RobotCase, raw: Mapping[str, Prepared]) -> tuple[JointRows, ...]:
    """Training rows of all joints with their declared models."""
    return stack({joint: p.train for joint, p in raw.items()}, {j: p.terms for j, p in raw.items()}, case.causes)


def _at_its_offset(
    case: RobotCase, logs: RobotLogs, raw: Mapping[str, Prepared], found: SharedSearch, thresholds: SearchThresholds
) -> tuple[RobotCase, SharedSearch]:
    """The case with columns at the encoder's offset that was found, and the causes that are found with them.

    Loads are not linear in an offset, and what a slope leaves of a large one can look like another cause.
    """
    for _ in range(MOST_OFFSETS):
        offsets = {c.where: value for c, value in _first_values(found) if c.id == "encoder_offset"}
        if not offsets:
            break
        case = replace(case, causes=columns_over(logs, [*case.train, *case.held], case.rig, offsets))
        found = _search(case, raw, thresholds)
    return case, found


def _first_values(found: SharedSearch) -> list[tuple[Cause, float]]:
    """The chosen causes with their first coefficients: those of the chosen causes come first in a fit."""
    ends = np.cumsum([0, *(cause.size for cause in found.chosen)])
    return [(cause, float(found.fit.delta[end])) for cause, end in zip(found.chosen, ends, strict=False)]


def _touched(found: SharedSearch, joints: Sequence[str]) -> list[str]:
    """Joints whose error the shared causes change noticeably."""
    change = np.abs(np.log(found.fit.cv_rms / found.baseline.cv_rms))
    return [joint for joint, each in zip(joints, change, strict=True) if each > 0.01]


def _evidence(case: RobotCase, prepared: Mapping[str, Prepared], found: SharedSearch) -> float:
    """Log evidence for the shared causes against joints that explain their part alone, parameters paid."""
    evidence, rows, size = 0.0, 0.0, sum(c.size for c in found.chosen)
    train, held = (case.at_motors(runs) for runs in case.without(found.fit))
    for joint in _touched(found, case.rig.joints):
        case.progress(f"{joint}: alone or shared", 0.0)
        alone = own_search(prepared[joint], case.options)
        mended = prepare_joint(train, held, case.rig, joint)
        mine = own_search(mended, case.options)
        count = effective_samples(mine.chosen.residual, mended.train.samples)
        errors = [_own_error(alone, prepared[joint]), _own_error(mine, mended)]
        evidence += count * float(np.log(errors[0] / errors[1]))
        rows += count
        size += mine.chosen.size - alone.chosen.size
    return evidence - 0.5 * size * float(np.log(max(rows, 2.0)))


def _own_error(found: Search, prepared: Prepared) -> float:
    """Cross-validated RMS [effort], by the drive gain of the fit itself: see `StackedFit.cv_rms`."""
    return found.chosen.cv_rms / (prepared.train.gain or 1.0) * found.chosen.gain


def _settled(case: RobotCase, before: _Before, found: SharedSearch, thresholds: SearchThresholds) -> RobotResult:
    """Causes and coefficients beside the joints' own effects; joints that have some are diagnosed anew on such loads.

    A cause that is no longer real beside them was their imperfect form, and goes.
    """
    joints = case.rig.joints
    made = _diagnosed(case, before, found.fit, joints)
    own = [joint for joint, result in made.items() if result.effects]
    if own:
        rows = stack({j: p.train for j, p in before.raw.items()}, _terms(made), case.causes)
        kept = search_shared(rows, case.causes.causes, before.floor, thresholds, among=found.chosen)
        again = own if len(kept.chosen) == len(found.chosen) else joints
        found = kept
        made |= _diagnosed(case, before, found.fit, again)
    rows = stack({j: p.train for j, p in before.raw.items()}, _terms(made), case.causes)
    more = _with_error_beyond_tolerance(rows, case.causes.causes, before.floor, found)
    if more is not None:
        found = more
        made |= _diagnosed(case, before, found.fit, joints)
    train, held = both_sides(before.raw, _terms(made), case.causes)
    fitted = fit_stacked(train, *active(case.causes.causes, found.chosen))
    results = {joint: original_baseline(made[joint], before.prepared[joint]) for joint in joints}
    declared = _declared(case, before.raw)
    sets = substituted(found.chosen, found.alternatives)
    alternatives = [fit_stacked(train, *active(case.causes.causes, each)) for each in sets]
    results = with_shared_uncertainty(results, (declared, before.fitted), (train, fitted), alternatives)
    if _in_effort(case):
        results = with_uncertain_gains(results, train, fitted, 0.0)
    train_after, held_after = case.without(found.fit)
    return RobotResult(
        joints=results,
        shared=shared_effects(train, held, case.causes, found.chosen, found.alternatives),
        held=case.at_motors(before.held),
        held_after=case.at_motors(held_after),
        train_after=case.at_motors(train_after),
        robot_gains=robot_gains(results, dict(zip(joints, map(float, fitted.sigma), strict=True))),
    )


def _diagnosed(case: RobotCase, before: _Before, fitted: StackedFit, joints: Sequence[str]) -> dict[str, JointResult]:
    """These joints by themselves, on loads without the fit's causes."""
    train, held = case.without(fitted)
    if not _in_effort(case):
        return case.diagnose(train, held, joints)
    hold = gains_to_hold(_declared(case, before.raw), fitted)
    return diagnosed_beside_noise(case, train, held, joints, hold)


def _in_effort(case: RobotCase) -> bool:
    """Whether the recorded efforts hold most of the noise."""
    return all(cause.in_effort for cause in case.causes.causes)


def _with_error_beyond_tolerance(
    rows: Sequence[JointRows], causes: Sequence[Cause], floor: FloatArray, found: SharedSearch
) -> SharedSearch | None:
    """With one more error of a sensor; None where there is none that evidence tells beside what was found.

    All causes are compared, so that a link's mass or centre that explains as much keeps a sensor from being named.
    """
    more = search_shared(rows, causes, floor, BEYOND_TOLERANCE_BESIDE, beside=found.chosen)
    added = [cause for cause in more.chosen if cause not in found.chosen]
    if not added or not added[0].tolerance:
        return None
    shows = 1.0 - more.fit.cv_rms / more.baseline.cv_rms >= BEYOND_TOLERANCE_BESIDE.second_gain
    if (more.fit.cv_rms > NEAR_NOISE * floor)[shows].any():
        return None
    return SharedSearch(more.chosen, more.fit, found.baseline, (*found.alternatives, *more.alternatives))


def _terms(joints: Mapping[str, JointResult]) -> dict[str, Sequence[Term]]:
    return {joint: result.final.terms for joint, result in joints.items()}
