"""`Encoder`: the joints' position sensors."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import MatrixGain

from drake_tc.robot.robot import Robot
from drake_tc.sensing.fault import SensorFault
from drake_tc.sensing.sensor import Sensor
from drake_tc.sensing.spec import SensorSpec


class Encoder(Sensor):
    """Positions of n joints, link side: `truth` (n) [rad or m] to `reading` (n). See `Sensor`."""


def add_encoder(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    robot: Robot,
    spec: SensorSpec,
    dt: float,
    faults: Sequence[SensorFault] = (),
    seed: int = 0,
) -> Encoder:
    """Add an Encoder of the robot's joints to the builder and wire it to a plant that is already in it.

    Between them stands `joint_positions`, which picks the positions from the plant's state in the robot's order.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant with the robot.
        robot: Names the joints.
        spec: [rad or m].
        dt: Period [s].
        faults: When it fails.
        seed: Of its random numbers.

    Returns:
        The system.

    Raises:
        ParamsError: As `Sensor`.
    """
    model = plant.GetModelInstanceByName(robot.name)
    joints = [plant.GetJointByName(name, model).index() for name in robot.joints]
    pick = plant.MakeStateSelectorMatrix(joints)[: len(joints)]
    gain: Any = np.ascontiguousarray(pick)
    positions = builder.AddNamedSystem("joint_positions", MatrixGain(gain))
    encoder = Encoder(len(joints), spec, dt, faults, seed)
    builder.AddNamedSystem("encoder", encoder)
    builder.Connect(plant.get_state_output_port(), positions.get_input_port())
    builder.Connect(positions.get_output_port(), encoder.GetInputPort("truth"))
    return encoder
