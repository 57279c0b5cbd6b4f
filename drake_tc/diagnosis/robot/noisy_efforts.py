"""Drive gains that the noise of the efforts does not shrink, for loads that are made of the encoders alone.

A joint's regression has the load l as its target and the effort y among its columns. Noise of variance v in y makes
1/K too small. With both less what friction and effects explain of them, least squares gives s_ly/s_yy, and

    1/K = s_ly/(s_yy - v),   at most s_ll/s_ly          the reverse regression, as if all noise were in y

(errors in variables; Fuller, 1987, "Measurement error models", section 1.2; Frisch, 1934, for the bound). A joint whose
effort is nearly all friction has a small s_yy: a noise of a third of it, which no one sees in the friction, makes 1/K
11 % too small. Part of the load is then left, and a wrong gain or a play explains it. Such a joint is diagnosed again
with its drive held at that gain, until the model found tells the gain at which it was found.
"""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.diagnosis.problem.shared.gain_dilution import TOLD, shared_variance, stiffness_to_hold
from drake_tc.diagnosis.problem.shared.rows import JointRows
from drake_tc.diagnosis.problem.shared.stacked import StackedFit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.robot.case import RobotCase
from drake_tc.effects.elasticity import Elasticity
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


def gains_to_hold(rows: Sequence[JointRows], fitted: StackedFit) -> dict[str, float]:
    """By joint, K [effort/(N m)] of those whose loads do not tell it, by the reverse regression (`gain_dilution`).

    By itself such a joint could make 1/K and all its torques small, and take the load away by an effect.

    Args:
        rows: Training rows of all joints with their declared models.
        fitted: All of them together.
    """
    return {
        r.joint: 1.0 / stiffness_to_hold(r, fitted, number)
        for number, r in enumerate(rows)
        if shared_variance(r, fitted, number) < TOLD
    }


def diagnosed_beside_noise(
    case: RobotCase, train: Sequence[Run], held: Sequence[Run], joints: Sequence[str], hold: Mapping[str, float]
) -> dict[str, JointResult]:
    """Each of the joints by itself, anew where the noise of the effort has changed its drive gain.

    Args:
        case: The robot's runs.
        train: Those to fit, with the loads of the results.
        held: Held-out runs, the same.
        joints: Which.
        hold: By joint, gains at which the first diagnosis holds the drive (`gains_to_hold`).
    """
    gains = dict(case.rig.drive_gain)
    out = case.diagnose(train, held, [joint for joint in joints if joint not in hold])
    doubted = {joint: gain for joint, gain in hold.items() if joint in joints}
    for _ in range(MOST_ROUNDS):
        if doubted:
            gains |= doubted
            at_gains = replace(case, rig=replace(case.rig, drive_gain=gains))
            for barred, some in _grouped(doubted, hold):
                options = replace(case.options, without=barred)
                out |= replace(at_gains, options=options).diagnose(train, held, some)
        others = {j: _other_gain(r, case.rig.drive_gain.get(j), gains.get(j)) for j, r in out.items()}
        doubted = {joint: gain for joint, gain in others.items() if gain is not None}
        if not doubted:
            break
    return {joint: out[joint] for joint in joints}


def _grouped(doubted: Iterable[str], hold: Container[str]) -> Iterator[tuple[frozenset[str], list[str]]]:
    """Effects that are not looked for, and in which joints.

    A drive that is held has no other gain. Where the load does not tell the gain, it is next to nothing beside the
    torque of the rotor, and the wind-up of a gear would take this torque away.
    """
    joints = {joint: frozenset({ServoGain.id, *((Elasticity.id,) if joint in hold else ())}) for joint in doubted}
    for barred in dict.fromkeys(joints.values()):
        yield barred, [joint for joint, each in joints.items() if each == barred]


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
