"""Every number that decides in a diagnosis: priors of effects and nuisances, and the few levels of confidence.

Sizes are in units of the rig, so that no number depends on a unit: a coefficient's contribution to the effort over the
RMS of the effort, an age over the period of its channel, a friction over the Coulomb friction.

Levels of what is said were set on simulated rigs of calibration seeds, many of which lack nothing, and are evaluated on
rigs of other seeds (docs/benchmarks.md).
"""

import numpy as np

COMMON = -5.0
"""Log prior odds that a common effect acts: one of a hundred and fifty, as a joint lacks one or two of some forty."""
UNCOMMON = -10.0
"""The same of an uncommon effect."""
ORDER = 0.05
"""Log prior odds by which each effect of the library is less common than the one before it."""
FALLS = 3.0
"""Log predictive density of the held-out runs that an effect must cost before it does not hold."""

CONTRIBUTION = 0.2
"""Standard deviation of an effect's contribution to the effort over the RMS of the effort."""
CAUSE_CONTRIBUTION = 1.0
"""The same of a cause of the whole robot, where it contributes most: a tool can be all that a wrist bears."""
GAIN_ERROR = 0.2
"""Standard deviation of a sensor's gain that is asked for: beyond it, a sensor is not wrong but another one."""
DECLARED_CONTRIBUTION = 3.0
"""The same of a declared term, about which the prior says nothing but its scale."""
HELD_GAIN = 1e-6
"""Relative standard deviation of a drive gain that is held at its declared value."""

UNIFORM = 1.0 / np.sqrt(12.0)
"""Standard deviation of a uniform prior over its range: an age over one period, a shape over its plausible range."""
AGE_PERIODS = (0.25, 0.4)
"""Mean and standard deviation of a channel's age over its period: an instant has 0, a hold or an average 1/2."""
AGE_REACH = 4.0
"""Standard deviations of its prior beyond which an age is a delay."""
LATE = float(np.log(0.1))
"""Log prior odds that a channel comes late by another way: a bus, a buffer, another process."""
LATE_S = 0.003
"""Mean and standard deviation of how much later it then is [s]: a few cycles of a field bus or of a serial bus."""
LINEAR = 0.1
"""Curvature of what an age does over the noise, up to which it is linear in the age."""
SERVO_LAG_S = (0.001, 0.001)
"""Mean and standard deviation of the lag inside a position servo (rate filter, tick, current loop) [s]."""
DRIVE_LAG_S = (0.0, 0.0003)
"""The same of a drive that is commanded in current, voltage or torque [s]."""

FRICTION_FORM = 0.02
"""Standard deviation of what friction near rest differs from Coulomb and viscous friction, over the Coulomb one."""
SLOW = 0.2
"""Speed at which this difference has fallen to a third, over the RMS speed."""

LEAST_GAIN = 1e-6
"""Drive gain over that of the declared fit below which a set needs no effort at all."""
NEGLIGIBLE = 0.005
"""RMS of a shared parameter's part of a joint's effort, by what the other joints leave open, over the joint's noise
floor, below which the part is left out."""
RUN_SPREADS = (0.0, 0.01, 0.03, 0.1)
"""Tried standard deviations of what differs from run to run: friction over its mean, zeros over the effort's RMS."""
DISTORTED = 1.1
"""Error of a fit that whitens the residual over that of one that does not, above which the residual is no noise."""
RATIOS = (0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4)
"""Tried variances of the slow discrepancy over that of the white noise."""
MEMORIES_S = (0.03, 0.1, 0.3, 1.0, 3.0)
"""Tried correlation times of the slow discrepancy [s]."""
RESTS = (0.0, 3.0, 30.0, 300.0, 3e3, 3e4)
"""Tried variances of what friction leaves near rest over that of the white noise."""
MOVING = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""Tried variances of what grows with the speed over that of the white noise, at the RMS speed."""
NEAR_REST = 0.02
"""Speed within which a joint is near rest over its RMS speed."""

PARTS = 20
"""Parts of a log whose disagreement about a parameter widens its interval."""
NOISE_LEVEL = 0.3
"""Relative standard deviation of what a sensor's noise, estimated from its log, takes off a coefficient."""

NAMED_FLOORS = 0.5
"""RMS contribution in noise floors below which no effect is named, whatever its evidence."""
TAKEN_OVER = 2.0
"""Standard deviations of its prior up to which something takes over what an effect contributes or a residual shows."""
ALTERNATIVE = 3.0
"""Difference of log odds within which two sets of effects are indistinguishable: 95 % against 5 %."""
NAMED = ALTERNATIVE - COMMON
"""Log evidence from which a common effect is named."""
SEEN = 8.0
"""Log likelihood ratio from which an effect counts as visible in the logs."""
CANNOT_TELL = 0.1
"""Smallest visible torque error over the signal from which the logs cannot tell."""
PASSED_ON = 0.05
"""Slope du*/du of a drive effect below which the drive does not pass the effort on."""
MOST_EFFECTS = 6
BEAM = 3

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
"""Share of block resamples in which a held command must leave the smaller error ..."""
CERTAINLY_BETTER = 0.98
"""... and of those of all rows, where the rows that lie alike on both sides of a reversal leave it open."""

LEAST_EFFORT = 0.05
"""Share of an effort that alone tells an unknown load which declared drive effects must leave."""

SAME_ERROR = 0.02
"""Rise of the cross-validated error that a simpler form of a declared effect or load may bring."""

# What is left

LEAST_FLOORS = 1.5
"""RMS of the residual in noise floors below which nothing is flagged."""
MOST_FLOORS = 3.0
"""... above which more is left than the floor explains, if it is also more than `LEAST_OF_BEFORE`."""
LEAST_FRACTION = 0.25
"""Smallest share of the residual's variance that a function of the signals must explain."""
LEAST_RMS = 0.6
"""Smallest RMS of that share, in noise floors ..."""
LEAST_OF_BEFORE = 0.05
"""... as a share of the error before ..."""
LEAST_OF_SIGNAL = 0.002
"""... and as a share of the RMS of the effort: no drive gain, clock or filter is more accurate."""
LEAST_LOG_EVIDENCE = 25.0
"""Evidence of that share, in effective samples of what is left: noise that wanders has few."""
MOST_GROWTH = 2.5
"""How many times the training error the held-out one may be: beyond it the model does not carry over ..."""
LEAST_GROWTH = 0.25
"""... by at least this share of the held-out error before; so too for all that lies beyond the range of the training
runs, for stretches and for lines."""
LEAST_BURST = 3.0
"""How many times the typical half-second RMS a confined stretch must reach."""
LEAST_LINE = 0.25
"""Share of the residual's variance that one spectral line must hold."""
LEAST_WANDER = 0.6
"""Share of the held-out residual, its mean included, that its own neighbourhood in time must explain where a sensor is
said to wander."""
LEAST_BEYOND = 0.8
"""Share of the held-out residual's energy that must lie outside the range of the training runs for the residual to be
called an error of extrapolation."""
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
