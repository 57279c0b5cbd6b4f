"""Every threshold that decides what a diagnosis says, in the order in which they are asked.

They were set on simulated rigs of calibration seeds, many of which lack nothing, and are evaluated on rigs of other
seeds (drake_tc/diagnosis/README.md).
"""

from dataclasses import dataclass, replace

import numpy as np

# Signs of columns, and whether the declared model can be fitted at all

NO_STIFFNESS = 1e-9
"""1/K over the torque per effort of the rows, at or below which the effort does not enter the balance."""
LOAD_EXPLAINS = 0.95
"""Share of the effort beside friction that the load must leave at most for the effort to rise with it where 1/K rests
at 0: a correlation of 0.31 with friction of any sign taken out of both."""
CLEARLY_WORSE = 2.0
"""Error of the balance with the load as it is over that with the load turned, from which the sign is wrong.

A missing effect that follows the motion can make the turned load fit better, but hardly twice as well."""
LEAST_UNEXPLAINED = 0.1
"""Share of the effort that the balance must leave before a sign is questioned: a missing effect of a few per cent can
weigh more than the load of a joint that works against its own friction and rotor."""
MAX_CONDITION = 300.0
"""Condition number of the declared model's scaled columns, above which its parameters cannot be told apart."""

HELD_FROM_PERIOD = 4e-3
"""Period of a log [s] from which on a position servo's command is taken to hold between samples. On a faster clock half
a period is less than a drive's own delay, which the effect `delay` tells where it is longer than that."""
HELD_CERTAIN = 0.90
"""Share of block resamples in which a held command must leave the smaller error."""

AGES = (0.25, 0.5, 0.75, 1.0)
"""Ages of an effort that are tried [sampling periods]; a controller that runs faster than the log holds it for less."""
AGES_OF_COMMAND = (0.125, 0.25, 0.375)
"""Ages of a position servo's command that are tried between those of a continuous one, 0, and of one that is recorded
as it is written and held, 0.5 [sampling periods]. The servo's stiffness makes viscous friction of an error of them."""
OF_HELD_EFFORT = 0.6
"""Delay in sampling periods that the hold of an effort explains: half a period, and a tenth for jitter."""
BESIDE_TORQUE_SENSOR = 1.0
"""The same where the torque is measured, perhaps at the end of the hold."""

LEAD_FLOORS = 1.5
"""Noise floors that the declared model must leave before the effort is taken to be recorded late."""
LEAD_LEAVES = 0.5
"""Share of the declared model's error that it may leave at most with an earlier effort."""
LONGEST_LEAD = 0.05
"""Longest time by which an effort is recorded late [s], and the number of leads tried up to it."""
LEADS = 6

# Search: what counts as a real improvement

LEAST_EFFORT = 0.05
"""Share of an effort that alone tells an unknown load which drive effects must leave: of less, noise decides. Errors
count as shares of what is left (`problem.effort_left`), so that a drive that is limited most of the time is found, and
an effect that takes the effort away is not.
"""
LEAST_EFFORT_OF_LINKS = 0.7
"""The same of an effort that fitted links explain: their many coefficients explain what little is left of it."""
LEAST_DRIVE = 0.01
"""1/K over that of the declared model, below which a set of effects explains the load without the drive."""


@dataclass(frozen=True)
class SearchThresholds:
    """When a larger model is taken, and how far the search looks.

    An improvement is real when the evidence of all joints together is large enough, when at least one joint's error
    falls by a share, in noise floors, and beside what earlier effects explain, as below; when enough joints support
    it, and when it holds in the resamples.

    Attributes:
        beam: Models kept at each size. refined: candidates whose shapes are refined. most: largest number added.
        near: Error of a candidate over that of the best, up to which it is refined.
        least_refined: Candidates that are refined however far from the best one: a coarse grid of shapes can leave the
            true effect with a larger error than another effect whose form fits it roughly.
        worth_refining: Relative drop of the error that the best candidate must bring after the first round.
        same: Relative difference of error below which models are as good as each other: the smaller one is taken.
        least_gain: Smallest relative drop of a joint's cross-validated RMS that one more effect must bring.
        least_log_evidence: Evidence of all joints that it must leave after its parameters are paid.
        least_share: Share of block resamples in which it must help.
        least_removed: Smallest RMS it must explain, in noise floors: less is nil in practice.
        least_of_first: ... and as a share of what the effects before it explain: a smaller remainder is more likely an
            imperfect form of those than a cause of its own. That does not hold for an effect that lowers the error by
            `own_gain` and leaves no more than `own_floors` noise floors: what corrects the form of another effect
            leaves some of the wrong form.
        least_of_special: The same of an effect over a special case of it, as a share of what the special case explains.
        promising_gain: Smallest relative drop from which on a second effect is tried beside one that is not real by
            itself: each of two effects can hide the evidence of the other.
        least_joints: Joints that must support it. second_gain, second_log_evidence: drop and evidence of a joint that
            does.
    """

    beam: int = 6
    refined: int = 6
    most: int = 4
    near: float = 1.5
    least_refined: int = 3
    worth_refining: float = 0.01
    same: float = 0.02
    least_gain: float = 0.05
    least_log_evidence: float = 8.0
    least_share: float = 0.98
    least_removed: float = 0.5
    least_of_first: float = 0.10
    least_of_special: float = 0.10
    own_gain: float = 0.5
    own_floors: float = 2.0
    promising_gain: float = 0.02
    least_joints: int = 0
    second_gain: float = 0.0
    second_log_evidence: float = 0.0


JOINT = SearchThresholds()
"""Of one joint whose load is measured."""

LEAST_REMOVED_OF_ESTIMATED_LOAD = 1.0
"""Noise floors that an effect must explain on a joint whose load a robot's model gives: the floor knows the sensors'
noise, but not what the filters do to an estimated load near reversals, which is about as large."""

FITTED_LINKS = replace(JOINT, beam=3, refined=4, most=5, least_gain=0.03, least_removed=LEAST_REMOVED_OF_ESTIMATED_LOAD)
"""Of one joint of a robot whose links are fitted. One effect of many lowers the error by less: what the links'
parameters, the other joints and effects not yet found leave is in every cross-validated figure. A gear of several
stages has a friction law, ripples and a delay of its own."""

SHARED = SearchThresholds(
    beam=1,
    refined=10**6,
    most=3,
    near=np.inf,
    worth_refining=-np.inf,
    least_gain=0.10,
    least_log_evidence=20.0,
    least_share=0.0,
    own_gain=np.inf,
    promising_gain=np.inf,
    least_joints=2,
    second_gain=0.05,
    second_log_evidence=5.0,
    least_of_special=0.0,
)
"""Of causes that no single joint owns: one that a single joint supports is that joint's own. A mass at a wrong place
explains nearly all of a payload, so what is left for the payload may be a small share of it."""

BEYOND_TOLERANCE_BESIDE = replace(
    SHARED,
    most=1,
    least_gain=0.02,
    least_log_evidence=40.0,
    least_removed=0.25,
    least_of_first=0.0,
    second_gain=0.02,
)
"""Of a sensor's error beyond its tolerance, looked for beside all that was found. Where the joints leave little more
than noise (`NEAR_NOISE`), evidence tells an error that lowers theirs by a few per cent: in 15 simulated cases of
calibration seed 100 no error within its tolerance came out beyond it, and the largest evidence of one was 46."""
NEAR_NOISE = 2.0
"""Noise floors that each joint may leave in which such an error shows."""

COMMON_DELAY = replace(
    SHARED,
    least_gain=FITTED_LINKS.least_gain,
    second_gain=FITTED_LINKS.least_gain,
    least_removed=FITTED_LINKS.least_removed,
)
"""Of a delay that all joints share. Beside fitted links one cause of many lowers an error by less; what guards against
another cause is that the joints must agree on the delay (`robot.common_delay`), half of them with support."""

LATE_ENCODER = replace(
    COMMON_DELAY,
    least_joints=1,
)
"""Of an encoder that comes late, over the declared models and over a delay of its joint's drive, which leaves the other
joints as they are."""

LAG_OVER_NOISE = 4.0
"""What a lag must explain, over what the same filter explains backwards in time."""
BEYOND_TOLERANCE = 3.0
"""Standard deviations, of tolerance and estimate together, beyond which a sensor's error is not expected."""
SOFTER_GEAR = 0.97
"""Error with the rows of a soft gear over that without, below which the gear is taken to be soft."""

# Confirmation: which runs may speak against an effect

RESOLVED = 4.0
"""Standard deviations that a wave of the encoder's error must reach if it is smaller than one step. Chance reaches four
with probability exp(-8) (Rayleigh's distribution), with a hundred periods tried in 3 % of the searches."""
MOST_OF_KNOWN_LOAD = 0.9
"""Share of a curve over the position that may be a multiple of the known load: from there on the curve says that the
scale of that load, of the inertia or of the drive is wrong."""
OWN_FORM = 3.0
"""RMS of the rest of such a curve, over that of the residual, from which on the rest has a form of its own all the
same."""
RUN_ACTS = 0.25
"""RMS of an effect's contribution to a run, in noise floors, from which on the run says something about it."""
HELDOUT_ACTS = 0.1
"""The same for all held-out runs together."""
RUN_CERTAIN = 0.98
"""Share of block resamples that must agree before a training run speaks against an effect, as in the search."""
HELDOUT_CERTAIN = 0.90
"""Share of block resamples of each held-out run, and of all together, in which an effect that acts there must lower the
error."""
MOSTLY_LEVEL = 0.5
"""Share of what an effect changes that its means over the runs hold, from which on it is evaluated as a level."""
LEAST_OVER_WANDER = 3.0
"""Standard deviations of a mean under noise that wanders as what is left does, which a level must reach. On calibration
seed 100 weak torque sensor biases reach 67 and more."""
FEW_RUNS = 3
"""Training runs from which on each is left out in turn. Two of them tell an effect beside the model of both."""

# Alternatives, and effects that were not tested

SAME_ERROR = 0.02
"""Rise of the error that an effect in another's place may bring to fit as well."""
CERTAINLY_BETTER = 0.98
"""Share of block resamples from which on the chosen effect is the better one all the same."""
UNTESTED_EFFORT = 1.1
"""Largest effort of the held-out runs over that of the training runs, above which a saturation was not tested."""

LEAST_UNCOMMON = 0.25
"""Relative drop of the cross-validated error of the model found from which on an uncommon effect is looked for."""
WANDER_SECONDS = 1.5
"""Distance of the knots of the line that follows a torque sensor as it wanders [s]."""

# What is left

MOST_WHERE_SLOW = 0.25
"""Share of the residual's energy in the slower half of the command's samples, up to which it grows with the speed."""


@dataclass(frozen=True)
class ResidualThresholds:
    """When a remainder counts as structure, and when it counts as more than noise.

    Attributes:
        least_floors: RMS of the residual in noise floors below which nothing is flagged.
        most_floors: ... above which more is left than the floor explains, if it is also more than `least_of_before`.
        least_fraction: Smallest share of the residual's variance that a function of the signals must explain.
        least_rms: Smallest RMS of that share, in noise floors.
        least_of_before: ... and as a share of the error before.
        least_of_signal: ... and as a share of the RMS of the effort: no drive gain, clock or filter is more accurate.
        least_log_evidence: Evidence of that share, in effective samples of what is left: noise that wanders has few.
        most_growth: How many times the training error the held-out one may be: beyond it the model does not carry over.
        least_growth: ... by at least this share of the held-out error before; so too for all that lies beyond the
            range of the training runs, for stretches and for lines.
        least_burst: How many times the typical half-second RMS a confined stretch must reach.
        least_line: Share of the residual's variance that one spectral line must hold.
        least_wander: Share of the held-out residual, its mean included, that its own neighbourhood in time must explain
            where a sensor is said to wander.
        least_beyond: Share of the held-out residual's energy that must lie outside the range of the training runs for
            the residual to be called an error of extrapolation.
    """

    least_floors: float = 1.5
    most_floors: float = 3.0
    least_fraction: float = 0.25
    least_rms: float = 0.6
    least_of_before: float = 0.05
    least_of_signal: float = 0.002
    least_log_evidence: float = 25.0
    most_growth: float = 2.5
    least_growth: float = 0.25
    least_burst: float = 3.0
    least_line: float = 0.25
    least_wander: float = 0.6
    least_beyond: float = 0.8


LONGEST_CORRELATION = 0.5
"""Longest correlation time [s] of the quiet part of a residual in which a loud stretch is an event."""
LOUD_SHARE = 0.25
"""Largest share of the half-second blocks that loud stretches may hold to count as confined."""
LOUD_ENERGY = 0.4
"""Smallest share of the residual's energy that they must hold."""
CORRELATED_NOISE_NOTED = 1.2
"""Noise floor with correlated noise over that without, from which on the report says so."""

# Refinement on free runs

LEAST_FREE_RUN_GAIN = 0.05
"""Share by which the mean absolute error of the free runs must fall."""
RESOLVED_FREE_RUN = 1.0
"""Mean absolute error of the free runs, in what the encoder resolves, up to which there is nothing to refine."""
