"""Places in the tables of n joints' feedforward; imports nothing, so that tables are built without Numba.

`joints` (n, 14) has a row a joint, `inverses` (I, 2) the kind (`joint_layout`) and the parameter of each drive effect
that is undone, in this order, `terms` (E, 4) each torque effect (`joint_layout`), `values` the numbers of these; those
of the first joint first.
"""

GAIN, LEVEL, DAMPING, REST, INERTIA, COMPLIANCE, HALF_GAP, SMOOTHING, INVERSES, INVERSES_END, LIMIT, SERVO = range(12)
"""K; constant parts of the effects; J; lead of a servo over a soft gear and its play; width of smoothed jumps; rows of
its inverses; largest torque; 1 for a position servo."""
TERMS, TERMS_END = 12, 13
"""Rows of its torque effects."""
COLUMNS = 14
