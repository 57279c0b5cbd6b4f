"""Tuning of a torque loop in a diagram that a function of the user's returns."""

from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, OutputPort

from drake_tc.analysis.torque_loop.tuned import Confirmed
from drake_tc.analysis.torque_loop.tuning_task import design_tasks
from drake_tc.analysis.tracking_error import JointTask
from drake_tc.analysis.tuning import Tuning
from drake_tc.control.gains import TorqueGains
from drake_tc.errors import ParamsError
from drake_tc.loops.function_diagram import FunctionEntry, FunctionLoop, FunctionScenario
from drake_tc.loops.torque.parts import LoopDesign
from drake_tc.loops.torque.wiring import TorqueLoop
from drake_tc.types import FloatArray


def function_tasks(entry: FunctionEntry, scenario: FunctionScenario, begin: float) -> list[JointTask]:
    """One task a joint of the loop of a function, for the motion that its signal `reference` has.

    Args:
        entry: Of the function.
        scenario: How long the motion lasts.
        begin: Errors are evaluated from here on [s].

    Raises:
        ParamsError: a function that does not return its torque loop, a loop without a reference, one that cannot be
            tuned, or a reference that follows the state of another system.
    """
    built, loop = _built(entry, scenario)
    time = np.arange(0.0, scenario.duration + 0.5 * loop.period, loop.period)
    return design_tasks(loop.design, time, _motion(entry.name, built, loop, time), begin)


def confirm_function(entry: FunctionEntry, scenario: FunctionScenario, tuning: Tuning, begin: float) -> Confirmed:
    """Simulate the function's loop as it is and with the tuned gains and window.

    Args:
        entry: Of the function; it takes `spec` and `gains`.
        scenario: How long the simulations last.
        tuning: Of the joints.
        begin: Errors are evaluated from here on [s].

    Raises:
        ParamsError: a function without these arguments.
    """
    if entry.rebuild is None:
        raise ParamsError(
            f"{entry.name}: expected a function with the arguments `spec` and `gains` of add_torque_loop, with which"
            " the tuned loop is simulated; --no-simulate leaves this out"
        )
    _, loop = _built(entry, scenario)
    designs = (loop.design, design := tuned_design(loop.design, tuning))
    errors = [_errors(*_with_loop(entry.name, entry.rebuild(scenario, d.spec, d.gains)), begin) for d in designs]
    joints = design.robot.joints
    return Confirmed(joints, np.array([errors]), np.zeros((0, 2, len(joints))))


def tuned_design(design: LoopDesign, tuning: Tuning) -> LoopDesign:
    """The loop with the tuned window and gains; joints that were not tuned keep theirs, and all keep K6."""
    own = design.gains
    loop = np.array([model.drive.gain for model in design.models]) * (1.0 + own.kp)
    kp, ki, k7 = own.kp.copy(), own.ki.copy(), own.kd * loop
    for joint in tuning.joints:
        i, chosen = design.robot.joints.index(joint.joint), joint.after.setting
        kp[i], ki[i], k7[i] = chosen.kp, chosen.ki, chosen.k7
    gains = TorqueGains.from_servo(design.models, own.ks * loop, k7, kp, ki=ki, kf=own.kf)
    filters = replace(design.spec.filters, window=tuning.window, encoder_order=tuning.order)
    return replace(design, gains=gains, spec=replace(design.spec, filters=filters))


def _built(entry: FunctionEntry, scenario: FunctionScenario) -> tuple[FunctionLoop, TorqueLoop]:
    return _with_loop(entry.name, entry.build(scenario))


def _with_loop(name: str, built: FunctionLoop) -> tuple[FunctionLoop, TorqueLoop]:
    if built.torque_loop is None:
        raise ParamsError(
            f"{name}: expected a function that returns the diagram and the loop of add_torque_loop, as"
            " (diagram, loop), which tune needs; got the diagram alone"
        )
    return built, built.torque_loop


def _motion(name: str, built: FunctionLoop, loop: TorqueLoop, time: FloatArray) -> FloatArray:
    """(T, 3, n) of the signal `reference`, which must be a function of time.

    Raises:
        ParamsError: no such signal, or one whose system has a state.
    """
    port: Any = loop.signals.get("reference")
    context = built.diagram.CreateDefaultContext()
    source: Any = None if port is None else port.get_system()
    own = None if source is None else source.GetMyContextFromRoot(context)
    if own is None or own.num_total_states() or source.num_input_ports():
        raise ParamsError(f"{name}: expected a loop whose signal `reference` depends on the time alone")
    rows = np.empty((time.size, port.size()))
    for row, now in enumerate(time.tolist()):
        context.SetTime(now)
        rows[row] = port.Eval(own)
    return rows.reshape(time.size, 3, -1)


def _errors(built: FunctionLoop, loop: TorqueLoop, begin: float) -> FloatArray:
    """(n,) RMS of q_d - q from `begin` on [rad]; infinite where the loop runs away."""
    simulator = Simulator(built.diagram)
    context = simulator.get_mutable_context()
    n = len(loop.design.robot.joints)
    now = {name: _reader(loop.signals[name], context) for name in ("reference", "joint_state")}
    rows = []
    for instant in np.arange(begin, built.scenario.duration, loop.period).tolist():
        try:
            simulator.AdvanceTo(instant)
        except RuntimeError:  # Drake's plant ends a run that leaves all bounds
            return np.full(n, np.inf)
        rows.append(now["reference"]()[:n] - now["joint_state"]()[:n])
    return np.asarray(np.sqrt(np.mean(np.square(rows), axis=0)))


def _reader(port: OutputPort, context: Context) -> Any:
    system: Any = port.get_system()
    own = system.GetMyContextFromRoot(context)
    return lambda: port.Eval(own)
