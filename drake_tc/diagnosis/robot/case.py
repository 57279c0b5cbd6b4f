"""A robot's runs, and what is done with each joint by itself, beside each other where there are processes."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from drake_tc.diagnosis.data.link_prior import LinkPrior
from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.joint import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Columns, Term, coefficients_by_term
from drake_tc.diagnosis.problem.command_hold import drop_by_hold, speaks_for_hold
from drake_tc.diagnosis.problem.estimates import shape_slopes
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.problem.shared.causes import CauseColumns
from drake_tc.diagnosis.problem.shared.correction import corrected
from drake_tc.diagnosis.problem.shared.momentum import LinkMomenta
from drake_tc.diagnosis.problem.shared.stacked import StackedFit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.selection.engine import Progress
from drake_tc.diagnosis.selection.joint import search
from drake_tc.diagnosis.selection.joint_problem import Search, candidates
from drake_tc.effects.base import Effect
from drake_tc.effects.library import looked_for
from drake_tc.effects.link_load import LinkLoad, link_load
from drake_tc.estimation.coupled_gears import at_motors
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

Result = TypeVar("Result")
FAST: Mapping[str, int] = {"beam": 1, "refined": 3}
"""Of a search whose result only tells the links what else acts in a joint: the whole diagnosis searches anew."""


@dataclass(frozen=True, eq=False)
class OwnModel:
    """One joint's own model: its terms without the links' parameters, and their columns.

    Attributes:
        terms: Without the links' parameters.
        design: (N, 1 + k + s) [y*, -phi ...] and the slopes by the s shape parameters (`shape_slopes`): the links are
            fitted, and their intervals computed, with shapes that may move along.
    """

    terms: tuple[Term, ...]
    design: FloatArray

    @staticmethod
    def of(columns: Columns, fitted: Fit) -> "OwnModel":
        """Of a fit to training rows."""
        terms = tuple(t for t in fitted.terms if not isinstance(t.effect, LinkLoad))
        each = [theta for term, theta in coefficients_by_term(fitted.terms, fitted.beta) if term in terms]
        slopes = shape_slopes(columns, terms, np.concatenate([fitted.beta[:1], *each]))
        return OwnModel(terms, np.column_stack([columns.design(terms), slopes]))


@dataclass(frozen=True, eq=False)
class RobotCase:
    """A robot's runs, and how to diagnose its joints.

    Attributes:
        train, held: Runs with loads from the robot's model.
        rig: With a `RobotLoad`.
        causes: Columns over all runs.
        options: Of the joints' own diagnosis.
        progress: Told how far it is.
        executor: Joints beside each other; None: one after the other, here.
        turns: (n, n) of the motors where gears couple joints (`estimation.coupled_gears`), by the rig's joints.
        momenta: Of fitted links whose runs' sampling instants scatter; None elsewhere.
    """

    train: Sequence[Run]
    held: Sequence[Run]
    rig: Rig
    causes: CauseColumns
    options: DiagnosisOptions
    progress: Progress
    executor: Executor | None
    turns: FloatArray | None = None
    momenta: LinkMomenta | None = None

    def at_motors(self, runs: Sequence[Run]) -> list[Run]:
        """The runs as the joints' own diagnosis sees them: positions are those of the motors."""
        return list(runs) if self.turns is None else at_motors(self.turns, self.rig.joints, runs)

    def without(self, fitted: StackedFit) -> tuple[list[Run], list[Run]]:
        """Both sides' runs without the fit's causes."""
        joints = self.rig.joints
        sides = (corrected(runs, self.causes, joints, fitted.columns, fitted.delta) for runs in (self.train, self.held))
        train, held = sides
        if self.momenta is not None:
            train, held = (self.momenta.added(runs, joints, fitted.columns, fitted.delta) for runs in (train, held))
        return train, held

    def prepared(self, train: Sequence[Run], held: Sequence[Run]) -> dict[str, Prepared]:
        """Each joint with its declared model."""
        train, held = self.at_motors(train), self.at_motors(held)
        options = self.options
        made = partial(
            prepare_joint,
            width_s=options.width_s,
            command_held=options.command_held,
            sampled_late=options.effort_age,
        )
        return {j: made(train, held, self.rig, j) for j in self.rig.joints}

    def diagnose(
        self,
        train: Sequence[Run],
        held: Sequence[Run],
        joints: Sequence[str],
        priors: Mapping[str, LinkPrior] | None = None,
        among: Mapping[str, tuple[Effect, ...]] | None = None,
    ) -> dict[str, JointResult]:
        """Each of the joints by itself.

        Args:
            train: Runs to fit.
            held: Held-out runs.
            joints: Which.
            priors: By joint, of the links' columns that the runs hold.
            among: By joint, the only effects that are looked for; None for the library.
        """
        known, train, held = priors or {}, self.at_motors(train), self.at_motors(held)
        options = {j: self.options if among is None else replace(self.options, effects=among[j]) for j in joints}
        return self.each(_diagnosed, {j: (train, held, self.rig, j, options[j], known.get(j)) for j in joints})

    def search(self, train: Sequence[Run], held: Sequence[Run], priors: Mapping[str, LinkPrior]) -> dict[str, OwnModel]:
        """Of each joint the model that a fast search of its own finds, without any later step."""
        train, held = self.at_motors(train), self.at_motors(held)
        options = replace(self.options, search=replace(self.options.search, **FAST))
        return self.each(_searched, {j: (train, held, self.rig, j, options, priors[j]) for j in self.rig.joints})

    def with_hold(self, train: Sequence[Run], priors: Mapping[str, LinkPrior] | None = None) -> "RobotCase":
        """The case with one answer for all position servos to whether they hold their commands (`command_hold`).

        Args:
            train: Runs to fit.
            priors: By joint, of the links' columns that the runs hold; None where the links are known.
        """
        servos = [j for j in self.rig.joints if self.rig.drive[j] == "position_servo"]
        if self.rig.command_hold is not None or not servos:
            return self
        train, width = self.at_motors(train), self.options.width_s
        known = priors or {}
        drops = self.each(_drop_by_hold, {j: (train, self.rig, j, known.get(j), width) for j in servos})
        if not any(each.size for each in drops.values()):
            return self  # a fast clock
        return replace(self, options=replace(self.options, command_held=speaks_for_hold(list(drops.values()))))

    def each(self, work: Callable[..., Result], arguments: Mapping[str, tuple[Any, ...]]) -> dict[str, Result]:
        """`work` of each joint's arguments."""
        if self.executor is None:
            made = {}
            for number, (joint, each) in enumerate(arguments.items()):
                self.progress(joint, number / len(arguments))
                made[joint] = work(*each)
            return made
        futures = {joint: self.executor.submit(work, *each) for joint, each in arguments.items()}
        made = {}
        for number, (joint, future) in enumerate(futures.items()):
            self.progress(joint, number / len(arguments))
            made[joint] = future.result()
        return made


def _diagnosed(
    train: Sequence[Run],
    held: Sequence[Run],
    rig: Rig,
    joint: str,
    options: DiagnosisOptions,
    link_prior: LinkPrior | None,
) -> JointResult:
    with threadpool_limits(1):
        return diagnose_joint(train, held, rig, joint, options, link_prior=link_prior)


def _searched(
    train: Sequence[Run],
    held: Sequence[Run],
    rig: Rig,
    joint: str,
    options: DiagnosisOptions,
    link_prior: LinkPrior | None,
) -> OwnModel:
    with threadpool_limits(1):
        prepared = prepare_joint(
            *(train, held, rig, joint),
            link_prior=link_prior,
            width_s=options.width_s,
            common=options.common,
            command_held=options.command_held,
            sampled_late=options.effort_age,
        )
        return OwnModel.of(prepared.train, own_search(prepared, options).chosen)


def _drop_by_hold(
    train: Sequence[Run], rig: Rig, joint: str, link_prior: LinkPrior | None, width_s: float | None
) -> FloatArray:
    loads = () if link_prior is None else (link_load(link_prior.mean.size),)
    with threadpool_limits(1):
        build = partial(build_samples, train, rig=rig, joint=joint, width_s=width_s)
        return drop_by_hold(build, rig, joint, link_prior, loads)


def own_search(prepared: Prepared, options: DiagnosisOptions) -> Search:
    """What one joint's own effects make of its loads."""
    usable, _ = candidates(looked_for(prepared.context, options.effects), prepared.context, prepared.declared)
    return search(prepared.train, prepared.terms, usable, prepared.context, prepared.floor, options.search)
