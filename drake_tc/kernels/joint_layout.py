"""Places in the arrays of n joints' actuators; imports nothing, so that tables are built without Numba.

A joint's memory, from its first place on: these nine (the motor's two only behind a gear with a TransmissionEffect),
then the states of hysteretic effects, then those of the drive's effects.
"""

STARTED, DEFLECTION, POSITION, VELOCITY, TORQUE, LOAD, COMMAND, MOTOR, MOTOR_VELOCITY = range(9)
"""1 once the joint has had a tick (`JUST_STARTED` at this first tick); z; q, v and torque to the plant at the last
update; all that resisted the joint in the step before it, as far as its motion told; command; motor's side."""
JUST_STARTED = 0.5

DEAD_ZONE, SWITCH, SATURATION, DELAY, LAG, INTEGRAL = range(6)
"""Kinds of drive effects with a compiled equation."""
INTERPRETED = -1
"""Kind of all others."""

FIRST, GEARED, COMPILED, SERVO, HYSTERETIC, HYSTERETIC_END, DRIVES, EFFORT_DRIVES, DRIVES_END, TERMS, TERMS_END = range(
    11
)
"""Columns of a joint's whole numbers: first place of its memory; behind a TransmissionEffect; all effects compiled;
position servo; places of its hysteretic states; rows of its effects of the command, and of those of the effort; rows of
its torque effects."""
TERM_KIND, TERM_FIRST, TERM_END, TERM_STATE = range(4)
"""Columns of a torque effect with a compiled equation: its kind (`torque_equations`), places of its numbers, place of
its hysteretic state in the memory or -1."""
PERIOD, INERTIA, ROTOR, PER_EFFORT, LEVEL, DAMPING, REST = range(7)
"""Columns of a joint's numbers: dt; what the torque to the plant moves; rotor; 1/K; constant parts of its effects."""
HALF_GAP, COMPLIANCE, CONTACT_TIME, MOTOR_INERTIA, LINK_INERTIA, SUB_STEP, SUB_STEPS = range(7, 14)
"""And of its gear."""
NUMBERS = 14

STATUS, FAULT, ACTED, DRIVE_POSITION, DRIVE_VELOCITY, LOAD_TORQUE, ASKED, EFFORT, NOW_LEVEL, NOW_DAMPING, NOW_REST = (
    range(11)
)
"""Columns of `work`: 1 where the step goes on; fault; command that acts; what the effects see; what they gave."""
WORK = 11

OUTPUTS = 5
"""Torque to the plant, motor torque, friction torque, effort asked for, fault."""
DONE, UNSTARTED, PENDING = range(3)
"""What a call has come to: joints that have to be started first, or whose effects have to be evaluated."""
