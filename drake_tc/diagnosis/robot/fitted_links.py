"""`close-loop` of a robot whose links' inertial parameters are fitted together with its joints' models.

1. All joints together, with the declared models: the links' parameters at the tolerance that the rig file declares
   (`problem.shared.stacked`). Where much of an effort is left, wider filters are tried. Whether position servos hold
   their commands is decided for all joints together. Where much is left, gross errors of the set-up are tried
   (`diagnosis.set_up`). With such an error no effects are looked for: a wrong set-up makes effects that are not there.
2. Efforts that are all recorded late (`common_delay.common_lead`); where they are, the declared models are fitted to
   the earlier efforts. A delay that all joints share (`common_delay`); where there is one, it is part of each joint's
   model from here on. An encoder that comes late (`late_encoder`); where there is one, its readings are moved from
   here on.
3. Each joint's own effects, searched on loads at that estimate, beside what the other joints leave open of the links
   (`problem.shared.open_directions`).
4. The links anew beside these effects; steps 3 and 4 until the effects no longer change.
5. Each joint's whole diagnosis on these loads, and the links beside what was confirmed (`confirmed_effects`). Effects
   whose sizes may all be zero by the uncertainty of the links go (`uncertain_sizes`).

The model before is that of step 1.
"""

from collections.abc import Mapping
from dataclasses import replace

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.shared.columns_of_runs import columns_over
from drake_tc.diagnosis.problem.shared.late_encoder_columns import (
    OwnMotion,
    late_encoder_columns,
    with_late_encoders,
)
from drake_tc.diagnosis.problem.shared.open_directions import with_links_of
from drake_tc.diagnosis.problem.shared.rows import stack
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.links import fitted_links
from drake_tc.diagnosis.result.rig_result import SharedEffect
from drake_tc.diagnosis.result.set_up import is_wrong
from drake_tc.diagnosis.result.shared_effects import original_baseline
from drake_tc.diagnosis.result.shared_uncertainty import with_shared_uncertainty, with_uncertain_gains
from drake_tc.diagnosis.result.widening import robot_gains
from drake_tc.diagnosis.robot.case import OwnModel, RobotCase
from drake_tc.diagnosis.robot.common_delay import DelayProblem, SharedDelay, common_delay, common_lead
from drake_tc.diagnosis.robot.confirmed_effects import confirmed_effects, with_first
from drake_tc.diagnosis.robot.encoders import in_time
from drake_tc.diagnosis.robot.late_encoder import EncoderProblem, estimated_anew, late_encoder
from drake_tc.diagnosis.robot.result import RobotResult
from drake_tc.diagnosis.robot.start import (
    Links,
    Start,
    as_commanded,
    at_width,
    declared_links,
    fitted_beside,
    in_wide_enough_band,
)
from drake_tc.diagnosis.robot.uncertain_sizes import without_uncertain_sizes
from drake_tc.diagnosis.set_up.find import check_set_up
from drake_tc.estimation.robot_loads import RobotLogs, with_robot_loads
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.record import Run
from drake_tc.robot.link_parameters import LinkModel

MOVES = 2
"""Of a late encoder's readings: its delay is known better once they have been moved."""
MOST_ROUNDS = 3
"""Of searching the joints' effects and fitting the links."""


def diagnose_fitted(case: RobotCase, logs: RobotLogs, model: LinkModel) -> RobotResult:
    """Diagnose such a robot. The held-out runs are looked at only after every choice is made.

    Args:
        case: The robot's runs.
        logs: The robot.
        model: Its links by the robot file.

    Raises:
        IdentificationError: a joint whose runs cannot identify even the declared model.
    """
    joints = case.rig.joints
    declared = as_commanded(in_wide_enough_band(case))
    set_up = check_set_up(logs, model, case.train, case.held, case.rig, declared.shares)
    wrong = is_wrong(set_up)
    if wrong:
        options = replace(declared.case.options, effects=(), assess_residual=False)
        declared = replace(declared, case=replace(declared.case, options=options))
    else:
        declared = _with_earlier_efforts(declared)
    start = declared
    first, delay = declared.links, None if wrong else _common_delay(declared)
    encoder = None if wrong else _late_encoder(declared, delay, logs, model)
    if encoder is not None:
        for _ in range(MOVES):
            start = _in_time(declared, encoder, logs)
            encoder = estimated_anew(encoder, _encoders(start, logs, model))
        delay = _common_delay(start)
    case = start.case
    late, raw = (case, start.prepared) if delay is None else _with_term(start, delay.term)
    links = _searched(late, raw, start.links if delay is None else declared_links(raw, case.causes))
    load = next(iter(case.rig.load.values()))
    tolerance = load.gain_tolerance if isinstance(load, RobotLoad) else 0.0
    prepared = declared.case.prepared(*declared.case.without(first.fitted))

    def widened(made: Mapping[str, JointResult], links: Links) -> dict[str, JointResult]:
        results = {j: replace(original_baseline(made[j], prepared[j]), links_fitted=True) for j in joints}
        results = with_shared_uncertainty(results, (first.rows, first.fitted), (links.rows, links.fitted))
        return with_uncertain_gains(results, links.rows, links.fitted, tolerance)

    made, links, sides = _confirmed(late, raw, links, {})
    results = widened(made, links)
    certain = without_uncertain_sizes(made, results)
    if certain is not None:
        made, links, sides = _confirmed(late, raw, links, certain)
        results = widened(made, links)
    final = {joint: result.final for joint, result in made.items()}
    train_after, held_after = (with_links_of(runs, final) for runs in sides)
    return RobotResult(
        joints=results,
        shared=tuple(each for each in (encoder, None if delay is None else delay.effect) if each is not None),
        held=case.at_motors(case.without(first.fitted)[1]),
        held_after=case.at_motors(held_after),
        train_after=case.at_motors(train_after),
        robot_gains=robot_gains(results, dict(zip(joints, map(float, links.fitted.sigma), strict=True))),
        links=fitted_links(model, case.causes, links.rows, links.fitted, tolerance),
        set_up=set_up,
    )


def _with_earlier_efforts(start: Start) -> Start:
    """The declared models with efforts as old as the joints together say that they are recorded late.

    The effort of a position servo holds the position, which is recorded at its own time.
    """
    if "position_servo" in start.case.rig.drive.values():
        return start
    problem = _delays(start)
    lead = common_lead(problem)
    if lead is None:
        return start
    return at_width(replace(start.case, options=replace(start.case.options, effort_age=-lead / problem.period)))


def _common_delay(start: Start) -> SharedDelay | None:
    """The delay that all joints share, or None."""
    return common_delay(_delays(start))


def _delays(start: Start) -> DelayProblem:
    """The declared models of all joints, whose drives may all be late."""
    held = {joint: p.held for joint, p in start.prepared.items()}
    terms = {joint: p.terms for joint, p in start.prepared.items()}
    rows = stack(held, terms, start.case.causes)
    return DelayProblem(start.prepared, start.links.rows, rows, start.links.fitted)


def _late_encoder(start: Start, delay: SharedDelay | None, logs: RobotLogs, model: LinkModel) -> SharedEffect | None:
    """The encoder that comes late, or None.

    Gears that couple joints have their encoders at the motors, and a servo's effort holds the position: there a late
    encoder acts as viscous friction.
    """
    if start.case.turns is not None or "position_servo" in start.case.rig.drive.values():
        return None
    return late_encoder(_encoders(start, logs, model), None if delay is None else delay.error)


def _encoders(start: Start, logs: RobotLogs, model: LinkModel) -> EncoderProblem:
    """What late encoders do to the declared models of all joints."""
    case, fitted, rows = start.case, start.links.fitted, start.links.rows
    pi = model.nominal.copy()
    links = fitted.columns < pi.size
    pi[fitted.columns[links]] -= fitted.delta[links]
    terms = {joint: p.terms for joint, p in start.prepared.items()}
    own = {
        r.joint: OwnMotion.of(start.prepared[r.joint].train, terms[r.joint], r, beta)
        for r, beta in zip(rows, fitted.beta, strict=True)
    }
    late = late_encoder_columns(logs, model, [*case.train, *case.held], pi, own)
    held = stack({joint: p.held for joint, p in start.prepared.items()}, terms, case.causes)
    train, held = (with_late_encoders(each, late) for each in (rows, held))
    places = {cause.where: rows[0].shared.shape[1] + cause.columns.start for cause in late.causes}
    return EncoderProblem(start.prepared, train, held, fitted, places)


def _in_time(start: Start, encoder: SharedEffect, logs: RobotLogs) -> Start:
    """The declared models on runs in which this encoder's readings are moved."""
    case, delay = start.case, encoder.parameters["delay"].value
    train, held = (
        with_robot_loads(logs, in_time(runs, encoder.where, delay), case.rig.joints) for runs in (case.train, case.held)
    )
    return at_width(replace(case, train=train, held=held, causes=columns_over(logs, [*train, *held], case.rig)))


def _with_term(start: Start, term: Term) -> tuple[RobotCase, dict[str, Prepared]]:
    """The case and its joints with a term more in each declared model."""
    options = replace(start.case.options, common=(*start.case.options.common, term))
    raw = {
        joint: replace(p, terms=(*p.terms, term), declared=(*p.declared, term.effect.id))
        for joint, p in start.prepared.items()
    }
    return replace(start.case, options=options), raw


def _searched(case: RobotCase, raw: Mapping[str, Prepared], links: Links) -> Links:
    """The links beside the effects that each joint lacks."""
    # Where no joint lacks anything, the links are those of the declared models, and another round finds the same.
    seen = [links.keys]
    for _ in range(MOST_ROUNDS):
        own = links.held_at(case).search(*links.sides(case))
        links = fitted_beside(raw, own, case.causes)
        if links.keys in seen:
            break
        seen.append(links.keys)
    return links


def _confirmed(
    case: RobotCase, raw: Mapping[str, Prepared], links: Links, made: dict[str, JointResult]
) -> tuple[dict[str, JointResult], Links, tuple[list[Run], list[Run]]]:
    """Each joint's diagnosis, the links beside what was confirmed, and both sides' runs that the joints were fitted to.

    `made` is an earlier diagnosis, empty for none.

    The whole diagnosis may withdraw effects that the fast search found, or find more. The links then belong to other
    models than the joints' final ones. They are fitted anew, and the joints are diagnosed again on these loads with the
    confirmed effects as the only candidates, until nothing changes.
    """
    joints = case.rig.joints
    for _ in range(1 + MOST_ROUNDS):
        among = {joint: confirmed_effects(result) for joint, result in made.items()} or None
        train, held, priors = links.sides(case)
        found = links.held_at(case).diagnose(train, held, joints, priors, among)
        made = {joint: with_first(made[joint], result) if made else result for joint, result in found.items()}
        beside = links.keys
        own = {joint: OwnModel.of(Columns(result.train.samples), result.final) for joint, result in made.items()}
        links = fitted_beside(raw, own, case.causes)
        if links.keys == beside:
            break
    return made, links, (train, held)
