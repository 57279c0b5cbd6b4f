"""Every threshold that decides what a diagnosis says, in the order in which they are asked.

They were set on simulated rigs of calibration seeds, many of which lack nothing, and are evaluated on rigs of other
seeds (docs/benchmarks.md).
"""

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
