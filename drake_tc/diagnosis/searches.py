"""Searches of one joint: on all rows, on the rows of a soft gear, and without the rows in which the teeth are apart.

Which rows are usable depends on the gear. With a soft gear the link still moves while the motor sticks. In a gear with
backlash, the motor crosses the gap when the transmitted torque changes its sign, and then oscillates on the stiffness
of its servo. During this time the encoder of the link does not show where the motor is. With the stiffness K of the
servo [N m/rad] and the reflected inertia J of the rotor [kg m^2], rows take no part within

    w = light kernel + min(2 pi sqrt(J/K), LONGEST_CROSSING)                                                (apart)

[s] of a sign change of the torque that the gear transmits.
"""

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

from drake_tc.diagnosis.data.open_gap import OpenGap
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import BalanceCoefficients, Columns, Term, coefficients_by_term
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.selection.engine import Progress
from drake_tc.diagnosis.selection.joint import search
from drake_tc.diagnosis.selection.joint_problem import Search, candidates
from drake_tc.diagnosis.selection.withdrawal import DidNotHold
from drake_tc.diagnosis.thresholds import SOFTER_GEAR
from drake_tc.effects.backlash import Backlash
from drake_tc.effects.base import Effect, TorqueEffect
from drake_tc.effects.elasticity import Elasticity
from drake_tc.effects.library import looked_for, uncommon
from drake_tc.effects.obstacle import Obstacle
from drake_tc.effects.torque_sensor_gain import TorqueSensorGain
from drake_tc.errors import IdentificationError

SEARCHED_SAMPLES = 200_000
UNKNOWN_INERTIA = 0.07
"""2 pi sqrt(J/K) where J is not known [s]: position loops of robot joints follow up to some 15 Hz."""
ON_MOTOR_SIDE = frozenset({"rotor_inertia", "torque_ripple"})
"""Loads that the gear does not transmit."""
LONGEST_CROSSING = 0.3
"""Upper limit of 2 pi sqrt(J/K) [s]: a slower position loop could not follow a motion."""


@dataclass(frozen=True)
class Stage:
    """One search: what it looked at and what it found."""

    prepared: Prepared
    subsample: Columns
    obstacles: tuple[tuple[str, Obstacle], ...]
    found: Search

    @property
    def passed_over(self) -> tuple[DidNotHold, ...]:
        """Effects that fitted best and whose values are impossible."""
        return self.found.passed_over


def searched(
    prepared: Prepared,
    options: DiagnosisOptions,
    progress: Progress,
    executor: Executor | None,
    without: frozenset[str] = frozenset(),
) -> Stage:
    """One search.

    Args:
        prepared: The joint.
        options: Thresholds and seed.
        progress: Told how far it is.
        executor: Refines proposals; None does it here.
        without: Ids of effects that are not searched for.
    """
    context, barred = prepared.context, without | options.without
    library = [each for each in looked_for(context, options.effects) if each.id not in barred]
    usable, obstacles = candidates(library, context, prepared.declared)
    rare, _ = candidates(uncommon(context) if options.effects is None else (), context, prepared.declared)
    subsample = columns = prepared.train
    if len(columns.samples.signals) > SEARCHED_SAMPLES:
        subsample = columns.changed(samples=columns.samples.subsample(SEARCHED_SAMPLES), target=None)
    found = search(
        subsample,
        prepared.terms,
        usable,
        context,
        prepared.floor,
        options.search,
        progress,
        executor,
        uncommon=rare,
    )
    return Stage(prepared, subsample, tuple(obstacles), found)


def _has(found: Search, kind: type[Effect]) -> bool:
    return any(isinstance(t.effect, kind) for t in found.chosen.terms)


def _wind_up(stage: Stage) -> float:
    """The compliance [rad/(N m)] of a gear that may wind up between the servo's encoder and the logged one, or 0.

    Elasticity and a torque sensor that reads too little scale the load alike. They differ in when the motor sticks:
    under a soft gear the link still moves. So when either was found, the rows are chosen anew as a soft gear has them.
    """
    gain = next((t for t in stage.found.chosen.terms if isinstance(t.effect, TorqueSensorGain)), None)
    if gain is None and not _has(stage.found, Elasticity):
        return 0.0
    soft = Elasticity()
    if soft.obstacle(stage.prepared.context):
        return 0.0
    shape = soft.shape_grid(stage.prepared.context)[0]
    tried = fit(stage.subsample, [*stage.found.baseline.terms, Term(soft, shape)])
    return soft.physical(tried.beta[-2:], shape, tried.gain)["compliance"]


def _on_soft_rows(
    prepared: Prepared, options: DiagnosisOptions, progress: Progress, executor: Executor | None
) -> Stage:
    """The search on the rows of a soft gear, of the elasticity where a gain of the torque sensor is only as good."""
    stage = searched(prepared, options, progress, executor)
    as_good = (term for others in stage.found.as_good for fitted in others for term in fitted.terms)
    if not _has(stage.found, Elasticity) and any(isinstance(term.effect, Elasticity) for term in as_good):
        stage = searched(prepared, options, progress, executor, without=frozenset({TorqueSensorGain.id}))
    return stage


def _open_gap(stage: Stage) -> OpenGap | None:
    """The gap with w of (apart) if backlash was found; its second term is `UNKNOWN_INERTIA` where J is not known."""
    if not _has(stage.found, Backlash):
        return None
    samples, chosen = stage.prepared.train.samples, stage.found.chosen
    known = BalanceCoefficients.of(chosen.terms, chosen.beta, samples.signals.rotor_inertia)
    period = 2.0 * math.pi * math.sqrt(known.inertia / known.stiffness) if known.inertia > 0.0 else UNKNOWN_INERTIA
    loads = [
        (t.effect, t.shape, theta)
        for t, theta in coefficients_by_term(chosen.terms, chosen.beta)
        if isinstance(t.effect, TorqueEffect) and t.effect.kind == "load" and t.effect.id not in ON_MOTOR_SIDE
    ]
    return OpenGap(samples.light.actual_width_s + min(period, LONGEST_CROSSING), tuple(loads))


def of_its_gear(
    prepare: Callable[..., Prepared], options: DiagnosisOptions, progress: Progress, executor: Executor | None
) -> tuple[Stage, Callable[..., Prepared]]:
    """The search on the rows that are usable with the joint's gear, and the function that prepares these rows.

    Args:
        prepare: `prepare_joint` of the joint's runs, with keywords that choose rows.
        options: Thresholds and seed.
        progress: Told how far it is.
        executor: Refines proposals; None does it here.
    """
    stage = searched(prepare(), options, progress, executor)
    if (compliance := _wind_up(stage)) > 0.0:
        soft = _on_soft_rows(prepare(compliance=compliance), options, progress, executor)
        if _has(soft.found, Elasticity) and soft.found.chosen.cv_rms < SOFTER_GEAR * stage.found.chosen.cv_rms:
            stage, prepare = soft, partial(prepare, compliance=compliance)
    if (gap := _open_gap(stage)) is not None:
        try:
            closed = searched(prepare(gap=gap), options, progress, executor)
        except IdentificationError:  # the load changes its sign so often that hardly a row is left
            return stage, prepare
        if _has(closed.found, Backlash):
            stage, prepare = closed, partial(prepare, gap=gap)
    return stage, prepare
