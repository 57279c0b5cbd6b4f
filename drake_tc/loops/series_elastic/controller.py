"""`series_elastic_controller`: torque control of series-elastic joints as a Diagram from readings to voltages.

The stages are wired by the same function as those of the simulated loop (`drake_tc.loops.series_elastic.wiring`).
"""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from pydrake.systems.framework import DiagramBuilder, System
from pydrake.trajectories import Trajectory

from drake_tc.actuation.joint_values import Models, model_list
from drake_tc.loops.boundary import ControlledJoints, Controller, add_input
from drake_tc.loops.loop_builder import LoopBuilder
from drake_tc.loops.series_elastic.scenario import SeriesElasticLoopSpec
from drake_tc.loops.series_elastic.wiring import add_series_elastic_control

INPUTS = {"motor_encoder": "motor_position", "torque_sensor": "spring_torque", "link_encoder": "position"}
"""Signal of the loop to the input port that brings it."""


def series_elastic_controller(
    joints: Sequence[str],
    models: Models,
    torque: Trajectory | Literal["input"] = "input",
    spec: SeriesElasticLoopSpec | None = None,
    *,
    accelerated: bool = False,
    stages: Mapping[str, System] | None = None,
    between: Mapping[str, System] | None = None,
    fused: bool = False,
) -> Controller:
    """The torque control of voltage-driven series-elastic joints as a Diagram from readings to commands.

    Input ports of the Diagram, each read every `spec.dt`:
        motor_position (n): before the springs [rad].
        spring_torque (n): of the gauges [N m]; with `spec.torque_from: gauge`.
        position (n): behind the springs [rad]; without gauges.
        reference_torque (n): of the springs [N m]; with `torque` "input".
        reference_acceleration (n): of the links [rad/s^2]; with `accelerated`.
    Output ports of the Diagram:
        command (n): voltages [V], before any delay.
        and the signals of the torque control: `measured_torque`, `friction`, `flags`, ...

    Args:
        joints: Names, in the order of the ports.
        models: What the controller takes the drives for, by joint or in that order.
        torque: What the springs shall carry (n) over time [N m]; "input": what the input port says.
        spec: How the joints are controlled; None: the defaults. Its `delay` and `sensors` are those of a simulation and
            are not used.
        accelerated: Whether there is an input port for the accelerations of the links.
        stages: Stage to a system of your own in its place, as in `add_torque_loop`.
        between: "stage.port" to a system of your own behind that output port.
        fused: Run the stages in one system, which gives the same numbers in less time.

    Raises:
        ParamsError: a model without spring, or a stage or place that the controller does not have.

    Example:
        >>> models = load_models(MODELS / "coman_like" / "coman_like_actuators.yaml")
        >>> controller = series_elastic_controller(list(models), models)
        >>> controller.GetOutputPort("command").size() == len(models)
        True
    """
    spec, builder, n = SeriesElasticLoopSpec() if spec is None else spec, DiagramBuilder(), len(joints)
    assumed = list(model_list(models, tuple(joints)))
    loop = LoopBuilder(builder, spec, None, spec.dt, stages=stages or {}, between=between or {})
    read = ("motor_encoder", "torque_sensor" if spec.torque_from == "gauge" else "link_encoder")
    loop.signals |= {name: add_input(builder, INPUTS[name], n) for name in read}
    left_out = [*read, *(("reference_torque",) if torque == "input" else ()), "reference_acceleration"]
    voltage = add_series_elastic_control(
        loop,
        assumed,
        torque if isinstance(torque, Trajectory) else add_input(builder, "reference_torque", n),
        add_input(builder, "reference_acceleration", n) if accelerated else None,
    )
    flags = tuple(f"torque_control/{joint}" for joint in joints) if "flags" in loop.signals else ()
    nowhere = np.full(n, np.inf)
    controlled = ControlledJoints(
        joints=tuple(joints), servo=(False,) * n, lower=-nowhere, upper=nowhere, period=spec.dt, flag_names=flags
    )
    signals = loop.signals | {"command": voltage}
    return Controller(builder, "series_elastic_controller", controlled, signals, left_out=left_out, fused=fused)
