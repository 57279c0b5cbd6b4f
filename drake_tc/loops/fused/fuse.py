"""`fuse`: one system in place of a diagram's stages.

`StageValues`: outputs and states of stages in a Context, whether they are systems of their own or fused.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort, System

from drake_tc.array_stage import ArrayStage, offered_stage
from drake_tc.errors import ParamsError
from drake_tc.loops.fused.plan import AlgebraicLoopError, Connections, Plan
from drake_tc.loops.fused.system import FusedStages, Scratch
from drake_tc.loops.loop_builder import split
from drake_tc.types import FloatArray

NAME = "stages"
"""Name of the system that replaces the stages."""


def fuse(builder: DiagramBuilder) -> FusedStages | None:
    """Replace the stages of a diagram that is under construction by one system that computes the same numbers.

    A call from Drake into Python costs some microseconds, and every port that a stage reads or computes costs one more.
    One system for all stages saves most of that; a single stage gains a little. The stages, and Drake's own blocks
    between them, are removed from the builder, so this is the last call before `builder.Build()`. The new system has
    the gains, parameters and initial states with which the stages were built; gains and parameters cannot be changed in
    its Context. Other systems stay, and so does a stage

    * if one of its connected output ports is not available on arrays (`ArrayStage.ports`),
    * if its class inherits `on_arrays` and defines methods of its own (`drake_tc.array_stage.offered_stage`),
    * if the diagram would get an algebraic loop, because outputs of the stage depend on more inputs on arrays
      (`ArrayStage.reads`) than they do as Drake's ports.

    A stage that was removed has no Context any more: its methods that take one raise a RuntimeError.

    Args:
        builder: Contains the loop, made for example by `add_torque_loop`, and its logs.

    Returns:
        The new system, named "stages". None if there is no stage to fuse; the builder is then unchanged.

    Raises:
        ParamsError: A required input port of a stage is not connected (an input that would be fixed in the Context
            counts as not connected), or a stage depends on its own output within a tick; the builder is unchanged.
            The builder exports a port of a stage: export ports after fusing. The stages are then already removed.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> builder = DiagramBuilder()
        >>> plant = add_robot_plant(builder, robot)
        >>> loop = add_torque_loop(builder, plant, robot, load_models(robot.actuators))
        >>> fuse(builder).get_name()
        'stages'
    """
    connections = {
        (system, int(index)): (source, int(port))
        for (system, index), (source, port) in builder.connection_map().items()
    }
    plan = _plan(_stages(builder), connections)
    if plan is None:
        return None
    system = FusedStages(plan)
    Scratch(system.bind)  # refuses an input port that is not connected while the builder is still unchanged
    exports = builder.num_input_ports() + builder.num_output_ports()
    for each in plan.fused:
        builder.RemoveSystem(each)
    if builder.num_input_ports() + builder.num_output_ports() != exports:
        raise ParamsError("fuse: the builder exports a port of a stage; export ports after fusing, from the new system")
    builder.AddNamedSystem(NAME, system)
    for number, given in enumerate(plan.given):
        builder.Connect(given.port, system.get_input_port(number))
    _connect_readers(builder, connections, plan, system)
    return system


def fused_stages(diagram: Diagram) -> FusedStages | None:
    """The system that `fuse` has put into a diagram; None where the stages are systems of their own."""
    found = diagram.GetSubsystemByName(NAME) if diagram.HasSubsystemNamed(NAME) else None
    return found if isinstance(found, FusedStages) else None


def _plan(offered: Mapping[System, ArrayStage], connections: Connections) -> Plan | None:
    """The plan of the stages that can be fused; None if there is none."""
    stages = _sufficient(offered, connections)
    if not stages:
        return None
    try:
        return Plan(stages, connections)
    except AlgebraicLoopError:
        exact = {system: stage for system, stage in stages.items() if _is_exact(system, stage)}
        if len(exact) == len(stages):
            raise
        return _plan(exact, connections)


def _stages(builder: Any) -> dict[System, ArrayStage]:
    """The systems that offer their calculations on arrays."""
    offered = {system: offered_stage(system) for system in builder.GetSystems()}
    return {system: stage for system, stage in offered.items() if stage is not None}


def _is_exact(system: System, stage: ArrayStage) -> bool:
    """Whether every output depends on all the inputs that are read for it on arrays."""
    inputs = [system.get_input_port(index).get_name() for index in range(system.num_input_ports())]
    for index in range(system.num_output_ports()):
        part = stage.part_with(system.get_output_port(index).get_name())
        read = () if part is None else (entering for entering, name in enumerate(inputs) if name in part.reads)
        if not all(system.HasDirectFeedthrough(entering, index) for entering in read):
            return False
    return True


def _sufficient(offered: Mapping[System, ArrayStage], connections: Connections) -> dict[System, ArrayStage]:
    """The stages whose output ports exist on arrays as far as they are in use."""
    found = dict(offered)
    while refused := [system for system in found if not _suffices(system, found, connections)]:
        for system in refused:
            del found[system]
    return found


def _suffices(system: System, stages: Mapping[System, ArrayStage], connections: Connections) -> bool:
    """Whether all output ports of a stage that are in use exist on arrays.

    A port that only enters an input that the reading stage does not use on arrays is not in use.
    """
    for (reader, entering), (source, leaving) in connections.items():
        if source is not system or stages[system].part_with(system.get_output_port(leaving).get_name()) is not None:
            continue
        if reader not in stages or reader.get_input_port(entering).get_name() in stages[reader].inputs:
            return False
    return True


def _connect_readers(builder: DiagramBuilder, connections: Connections, plan: Plan, system: FusedStages) -> None:
    """Connect each system outside that reads a stage, through a block that splits the signals of a level."""
    for level in sorted(set(plan.export_level.values())):
        sources = system.exported_at(level)
        sizes = [int(plan.exported[source].size) for source in sources]
        ports = split(builder, f"{NAME}_out_{level}", system.get_output_port(level), sizes)
        for (reader, entering), source in connections.items():
            if source in sources and reader not in plan.fused:
                builder.Connect(ports[sources.index(source)], reader.get_input_port(entering))


class StageValues:
    """Reads outputs and inputs, and reads and sets states, of the stages of a diagram in a Context.

    A stage that `fuse` has removed has no Context of its own; its values are those of the system that replaces it.
    """

    def __init__(self, root: Context, fused: FusedStages | None = None) -> None:
        """Keep the Context.

        Args:
            root: Of the whole diagram.
            fused: What `fuse` returned; None: every stage is a system of the diagram.
        """
        self._root: Any = root
        self._fused = fused

    def output(self, port: OutputPort) -> FloatArray:
        """Value of an output port.

        Raises:
            ParamsError: The port is one of a fused stage, and nothing reads it; or as `context_of`.
        """
        system: Any = port.get_system()
        fused = self._replacing(system)
        if fused is None:
            return np.array(port.Eval(self.context_of(system)))
        return fused.output(self.context_of(fused), port)

    def input(self, system: System, name: str) -> FloatArray:
        """Value of a vector input port.

        Raises:
            ParamsError: The port is one of a fused stage, and is not connected, or the stage does not use it; or as
                `context_of`.
        """
        fused = self._replacing(system)
        if fused is None:
            return np.array(system.GetInputPort(name).Eval(self.context_of(system)))
        return fused.input(self.context_of(fused), system, name)

    def next_state(self, system: System) -> FloatArray:
        """(S,) x[n+1] of a system with one group of discrete state and one periodic update.

        Raises:
            ParamsError: The system is a fused stage without state; or as `context_of`.
        """
        fused = self._replacing(system)
        if fused is None:
            after: Any = system.EvalUniquePeriodicDiscreteUpdate(self.context_of(system))
            return np.array(after.value())
        return fused.next_state(self.context_of(fused), system)

    def set_state(self, system: System, state: FloatArray) -> None:
        """Set the discrete state (S,) of a system with one group of it.

        Raises:
            ParamsError: The system is a fused stage without state, or with one of another size; or as `context_of`.
        """
        fused = self._replacing(system)
        if fused is None:
            self.context_of(system).SetDiscreteState(state)
        else:
            fused.set_state(self.context_of(fused), system, state)

    def context_of(self, system: System) -> Any:
        """The Context of a system that `fuse` leaves as it is.

        Raises:
            ParamsError: The system has none in this diagram.
        """
        any_system: Any = system
        try:  # of a system that was removed from its diagram, Drake returns the root
            found = any_system.GetMyMutableContextFromRoot(self._root)
            any_system.ValidateContext(found)
        except RuntimeError as error:
            raise ParamsError(
                f"{system.get_name()!r} has no Context in this diagram; if `fuse` has removed it, expected the system"
                " that `fuse` returned"
            ) from error
        return found

    def _replacing(self, system: System) -> FusedStages | None:
        """The system in place of a fused one; None for a system of the diagram."""
        return self._fused if self._fused is not None and self._fused.replaces(system) else None
