"""An experiment with known loads: its logs, what it is expected to bring, and what it gains."""

from dataclasses import dataclass

from drake_tc.experiments.design.expected import Expected
from drake_tc.experiments.design.goal import Goal
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.known_loads import KnownLoad
from drake_tc.experiments.design.run import JointDesign


@dataclass(frozen=True, eq=False)
class LoadRun:
    """One log of the experiment.

    Attributes:
        load: What hangs on the joint.
        design: The motion under it.
        seconds: That its periods last.
        worth: What the load brings: the gain of the experiment over the same one without this log; 1 if nothing.
    """

    load: KnownLoad
    design: JointDesign
    seconds: float
    worth: float


@dataclass(frozen=True, eq=False)
class LoadDesign:
    """The best experiment with known loads.

    Attributes:
        joint: The joint without loads. goal: What it is for.
        loads: That the user has.
        runs: The logs, one for each load that takes part.
        unloaded: The best design without loads; None where no motion without loads reaches the goal.
        refusal: Why none does.
        gain: Factor by which the loads lengthen the distances or shorten the intervals; infinite beside a refusal.
        expected: What the experiment is worth. without: the same of the best motion without loads, where it exists.
        sentences: In words.
    """

    joint: DesignJoint
    goal: Goal
    loads: tuple[KnownLoad, ...]
    runs: tuple[LoadRun, ...]
    unloaded: JointDesign | None
    refusal: str
    gain: float
    expected: tuple[Expected, ...]
    without: tuple[Expected, ...]
    sentences: tuple[str, ...]
