"""A scenario of the torque loop with its drives in sliding, where friction is linear: what a linear analysis takes."""

from dataclasses import replace
from pathlib import Path

from drake_tc.actuation.model_file import save_models
from drake_tc.actuation.sliding_models import sliding
from drake_tc.loops.scenarios.parts import ModelFactors
from drake_tc.loops.torque.parts import actuator_models, loop_robot
from drake_tc.loops.torque.scenario import Scenario


def sliding_scenario(scenario: Scenario, folder: Path, direction: float = 0.0) -> Scenario:
    """The scenario with drives, true and assumed, that hold only what is linear in sliding.

    The inverse of a dead zone in the controller's model is constant there as the dead zone itself is.

    Args:
        scenario: Whose drives.
        folder: Takes the two model files; must exist for as long as the scenario is used.
        direction: Of the sliding, 1 or -1; 0 takes the mean gain of drives that switch with it.

    Raises:
        ParamsError: drives that cannot be read.
    """
    robot = loop_robot(scenario)
    plain = replace(scenario, model_factors=ModelFactors())

    def saved(name: str, *, controller: bool) -> str:
        models = actuator_models(plain, robot, controller=controller)
        path = str((folder / f"sliding_{name}.yaml").resolve())
        save_models(sliding(models, direction), path)
        return path

    return replace(scenario, actuators=saved("actuators", controller=False), model=saved("model", controller=True))
