"""Both sides of every joint of a robot's rig, filtered and with the declared model known."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from drake_tc.diagnosis.close_loop import with_baseline
from drake_tc.diagnosis.declared import declared_terms, known_values, without_known
from drake_tc.diagnosis.design import Columns, Term
from drake_tc.diagnosis.preparation import build_samples, context_of
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig


@dataclass(frozen=True, eq=False)
class Prepared:
    """One joint with its declared model.

    Attributes:
        train, held: Columns of both sides.
        terms: The declared model.
        floor: Noise floor [effort].
    """

    train: Columns
    held: Columns
    terms: tuple[Term, ...]
    floor: float


def prepare_joint(train_runs: Sequence[Run], held_runs: Sequence[Run], rig: Rig, joint: str) -> Prepared:
    """Filter one joint's runs and fit its declared model.

    Raises:
        IdentificationError: the runs cannot identify it.
    """
    train = build_samples(train_runs, rig, joint)
    held = build_samples(held_runs, rig, joint, train.light.width_s)
    context = context_of(train, rig, joint)
    known = known_values(rig, joint)
    train, held = without_known(train, known), without_known(held, known)
    return Prepared(*with_baseline(train, held, declared_terms(rig, joint), context))


def prepare_joints(train: Sequence[Run], held: Sequence[Run], rig: Rig) -> Mapping[str, Prepared]:
    """`prepare_joint` of all joints of the rig."""
    return {joint: prepare_joint(train, held, rig, joint) for joint in rig.joints}
