"""The first fit of a robot whose links are fitted: all joints together, with their declared models."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.data.link_prior import LinkPrior
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.shared.causes import CauseColumns
from drake_tc.diagnosis.problem.shared.gain_dilution import TOLD, shared_variance, stiffness_to_hold
from drake_tc.diagnosis.problem.shared.open_directions import open_directions, with_open_directions
from drake_tc.diagnosis.problem.shared.rows import JointRows, prior_weighed, stack
from drake_tc.diagnosis.problem.shared.stacked import StackedFit, fit_stacked
from drake_tc.diagnosis.robot.case import OwnModel, RobotCase
from drake_tc.diagnosis.selection.shared import active
from drake_tc.errors import IdentificationError
from drake_tc.logs.record import Run

WIDER = (1.6, 2.5, 4.0, 6.3, 10.0)
"""Widths of the filters that are tried, over that which the encoders' noise asks for."""
LITTLE_LEFT = 0.25
"""Share of an effort's RMS, left by the declared model, below which no wider filters are tried."""
AS_WELL = 1.25
"""Share that may be left, over the smallest one, at filters that are taken."""
PRIOR_ROUNDS = 2
"""Of weighing the prior of the joints' sensor errors by what is left beside the links, and fitting anew."""


@dataclass(frozen=True, eq=False)
class Links:
    """The links' parameters beside some models of the joints.

    Attributes:
        own: By joint, its model. rows: training rows of all joints. fitted: all together.
    """

    own: Mapping[str, OwnModel]
    rows: tuple[JointRows, ...]
    fitted: StackedFit

    @property
    def keys(self) -> dict[str, frozenset[str]]:
        """Effects of the joints' models."""
        return {joint: frozenset(t.effect.key for t in model.terms) for joint, model in self.own.items()}

    def sides(self, case: RobotCase) -> tuple[list[Run], list[Run], dict[str, LinkPrior]]:
        """Both sides' runs at this estimate, with what the other joints leave open, and each joint's prior of it."""
        opened = open_directions(self.rows, self.fitted)
        train, held = (
            with_open_directions(runs, case.causes, self.fitted, list(opened.values()))
            for runs in case.without(self.fitted)
        )
        return train, held, {joint: each.prior for joint, each in opened.items()}

    def held_at(self, case: RobotCase) -> RobotCase:
        """The case with the drive gains of this estimate where none is declared, for joints by themselves.

        A joint by itself could shrink the links, its friction and 1/K by one factor, or take its load away by an effect
        of the opposite sign, and its residual in torque with them. All joints together are protected (`stacked`).
        """
        gains = {r.joint: 1.0 / stiffness_to_hold(r, self.fitted, j) for j, r in enumerate(self.rows)}
        return replace(case, rig=replace(case.rig, drive_gain=gains | dict(case.rig.drive_gain)))


@dataclass(frozen=True, eq=False)
class Start:
    """The declared models at one width of the filters.

    Attributes:
        case: With this width. prepared: joints with loads by the robot's file. links: all joints together.
        shares: By joint, share of the effort that is left, cross-validated.
        left: Largest of these, of joints that tell their drive gain.
    """

    case: RobotCase
    prepared: Mapping[str, Prepared]
    links: Links
    shares: Mapping[str, float]
    left: float


def in_wide_enough_band(case: RobotCase) -> Start:
    """The declared models at the narrowest filters at which they explain the efforts about as well as they can.

    Play and encoder errors change the motion in a way that the efforts do not show. Least squares answers such errors
    in its columns by shrinking the parameters. Where the declared model leaves much of an effort, wider filters are
    tried: slower motion is told more truly.
    """
    tried = [at_width(case)]
    default = max(p.train.samples.light.width_s for p in tried[0].prepared.values())
    for factor in WIDER:
        if tried[-1].left < LITTLE_LEFT:
            break
        try:
            tried.append(at_width(replace(case, options=replace(case.options, width_s=factor * default))))
        except IdentificationError:
            break  # too little motion is left between reversals
    enough = max(LITTLE_LEFT, AS_WELL * min(each.left for each in tried))
    return next(each for each in tried if each.left <= enough)


def as_commanded(start: Start) -> Start:
    """The declared models with commands held or not, as all joints together say beside the links of the first fit.

    Until the links are fitted, commands are taken to hold: viscous friction takes up half a period that is too much or
    too little, but it is not negative.
    """
    train, _, priors = start.links.sides(start.case)
    options = start.links.held_at(start.case).with_hold(train, priors).options
    case = replace(start.case, options=options)
    return at_width(case) if options.command_held is False else replace(start, case=case)


def at_width(case: RobotCase) -> Start:
    """The declared models at the width of the filters that the case's options have."""
    prepared = case.prepared(case.train, case.held)
    links = declared_links(prepared, case.causes)
    efforts = np.array([float(np.std(p.train.effort(()))) for p in prepared.values()])
    left = links.fitted.cv_rms / efforts
    # An effort that is nearly all friction tells hardly anything of the drive gain: 1/K comes out near 0, and what is
    # left of the effort is as large as the effort in any filter.
    told = np.array([shared_variance(r, links.fitted, j) >= TOLD for j, r in enumerate(links.rows)])
    shares = dict(zip(prepared, left.tolist(), strict=True))
    return Start(case, prepared, links, shares, float(np.max(left[told] if told.any() else left)))


def declared_links(raw: Mapping[str, Prepared], causes: CauseColumns) -> Links:
    """All joints together with their declared models."""
    return fitted_beside(raw, {joint: OwnModel(p.terms, p.train.design(p.terms)) for joint, p in raw.items()}, causes)


def fitted_beside(raw: Mapping[str, Prepared], own: Mapping[str, OwnModel], causes: CauseColumns) -> Links:
    """All joints together with these models."""
    columns = {joint: prepared.train for joint, prepared in raw.items()}
    terms = {joint: model.terms for joint, model in own.items()}
    rows = stack(columns, terms, causes, {joint: model.design for joint, model in own.items()})
    fitted = fit_stacked(rows, *active(causes.causes, ()), pooled=True)
    for _ in range(PRIOR_ROUNDS if any(r.precision is not None for r in rows) else 0):
        known = zip(rows, fitted.sigma.tolist(), fitted.share.tolist(), strict=True)
        rows = tuple(prior_weighed(*each) for each in known)
        fitted = fit_stacked(rows, *active(causes.causes, ()), pooled=True)
    return Links(own, rows, fitted)
