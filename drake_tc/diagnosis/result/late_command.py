"""A note on a delay of a position servo's loop: it may be a delay of the command, with another viscous friction.

With the stiffness K of the servo [N m/rad], a loop that is late by d answers q_d(t - d) - q(t - d), and a command that
is late by d makes it q_d(t - d) - q(t). To first order they differ by the torque K d dq/dt, which viscous friction
takes up; the rest, K d^2/2 times the acceleration, is small.
"""

from drake_tc.diagnosis.problem.columns import BalanceCoefficients, Columns, Term
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.diagnosis.selection.shape_refinement import refine
from drake_tc.diagnosis.timing_notes import LateCommand
from drake_tc.effects.delay import CommandDelay, Delay

HARDLY_WORSE = 1.25
"""Error with a late command over that with a late loop, up to which the note is made."""
EVALUATIONS = 30


def late_command(columns: Columns, final: Fit) -> tuple[LateCommand, ...]:
    """What a delay of the command alone would be, where the final model has one of the loop and fits hardly better.

    Args:
        columns: Training rows of a position servo.
        final: The final model.
    """
    loop = next((t for t in final.terms if type(t.effect) is Delay), None)
    if loop is None:
        return ()
    command = Term(CommandDelay(), loop.shape)
    terms = [command if t is loop else t for t in final.terms]
    other = refine(columns, fit(columns, terms), evaluations=EVALUATIONS)
    ratio = other.cv_rms / final.cv_rms
    if not ratio <= HARDLY_WORSE:
        return ()
    delay = next(t.shape["delay"] for t in other.terms if isinstance(t.effect, CommandDelay))
    own, others = (BalanceCoefficients.of(f.terms, f.beta).viscous for f in (final, other))
    return (LateCommand(delay, others, own, ratio),)
