"""Drive gains that the noise of the efforts does not shrink, for loads that are made of the encoders alone.

A joint's regression has the load l as its target and the effort y among its columns. Noise of variance v in y makes
1/K too small. With both less what friction and effects explain of them, least squares gives s_ly/s_yy, and

    1/K = s_ly/(s_yy - v),   at most s_ll/s_ly          the reverse regression, as if all noise were in y

(errors in variables; Fuller, 1987, "Measurement error models", section 1.2; Frisch, 1934, for the bound). A joint whose
effort is nearly all friction has a small s_yy: a noise of a third of it, which no one sees in the friction, makes 1/K
11 % too small. Part of the load is then left, and a wrong gain or a play explains it. Such a joint is diagnosed again
with its drive held at that gain, until the model found tells the gain at which it was found.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.robot.case import RobotCase
from drake_tc.effects.base import Effect
from drake_tc.effects.context import Context
from drake_tc.effects.library import looked_for
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.logs.record import Run

DIFFERS = 0.005
"""Relative difference of a gain from which on a joint is diagnosed again."""
MOST_ROUNDS = 3
DOUBTFUL = 0.5
"""Share of a drive's error, beside its declared gain, that must be left without the noise of the effort."""


def gain_beside_noise(result: JointResult) -> float:
    """K [effort/(N m)] of the joint's final model; that of the model where the load falls with the effort."""
    samples = result.train.samples
    columns = Columns(samples)
    design = columns.design(result.final.terms)
    both = np.column_stack([design[:, 0], columns.target])
    left = both - design[:, 1:] @ np.linalg.lstsq(design[:, 1:], both, rcond=None)[0]
    (yy, ly), (_, ll) = left.T @ left / len(left)
    if ly <= 0.0:
        return result.final.gain
    noise = min(samples.floor.effort_variance, yy - ly**2 / ll)
    return float((yy - noise) / ly)


def with_gains_beside_noise(
    case: RobotCase, train: Sequence[Run], held: Sequence[Run], made: Mapping[str, JointResult]
) -> dict[str, JointResult]:
    """The joints' results, those anew whose drive gain the noise of the effort has changed.

    Args:
        case: The robot's runs.
        train: Those to fit, with the loads of the results.
        held: Held-out runs, the same.
        made: By joint.
    """
    out, gains = dict(made), dict(case.rig.drive_gain)
    for _ in range(MOST_ROUNDS):
        doubted = {
            j: gain for j, r in out.items() if (gain := _other_gain(r, case.rig.drive_gain.get(j), gains.get(j)))
        }
        if not doubted:
            break
        gains |= doubted
        at_gains = replace(case, rig=replace(case.rig, drive_gain=gains))
        among = {joint: _without_gain(case, out[joint]) for joint in doubted}
        out |= at_gains.diagnose(train, held, list(doubted), among=among)
    return out


def _other_gain(result: JointResult, declared: float | None, held: float | None) -> float | None:
    """The gain at which a joint must be diagnosed anew; None where it need not."""
    told = gain_beside_noise(result)
    if declared is None:
        return told if abs(np.log(told / (held or result.final.gain))) > DIFFERS else None
    found = next((e for e in result.effects if e.id == ServoGain.id), None)
    if found is None:
        return None
    error = np.log1p(found.parameters["gain_error"].value)
    return declared if abs(np.log(declared / told)) < DOUBTFUL * abs(error) else None


def _without_gain(case: RobotCase, result: JointResult) -> tuple[Effect, ...]:
    """What is looked for in a joint whose drive is held."""
    context = Context(result.drive, "robot", frozenset(), joint_type=result.units.joint_type)
    return tuple(e for e in looked_for(context, case.options.effects) if not isinstance(e, ServoGain))
