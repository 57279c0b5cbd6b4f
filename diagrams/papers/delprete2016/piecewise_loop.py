"""Del Prete et al. (2016), section 3.2.3: the piecewise-linear model as feedforward, one joint of the leg, the others
locked.

The model has one curve for each direction of motion. At a reversal it switches by the *estimated* speed, 40 ms late,
and its step holds what the drive's damping cost at the speeds of the logs: more than there is to overcome at rest.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem, ValueProducer
from pydrake.systems.primitives import LogVectorOutput

from drake_tc.actuation.wiring import add_actuators
from drake_tc.analysis.torque_loop.one_joint import alone
from drake_tc.control.dynamics_terms import DynamicsTerms
from drake_tc.diagrams.papers.delprete2016.identification import experiment_scenarios, off_line_torque
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.identification.asymmetric import PiecewiseFit, ThreePieces, fit_three_pieces
from drake_tc.identification.identify import prepare
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import parse_rig
from drake_tc.loops.recording import write_log
from drake_tc.loops.torque.default_gains import joint_loops
from drake_tc.loops.torque.running import log_columns, simulate_scenario
from drake_tc.loops.torque.scenario import Scenario, sensor_suite
from drake_tc.loops.torque.stages import actuator_models, loop_robot
from drake_tc.registry import diagram_entry
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import Robot
from drake_tc.sensing.robot_sensors import add_encoder
from drake_tc.sensing.spec import Sampling
from drake_tc.sensing.suite import sensor_seed
from drake_tc.types import FloatArray

SWITCHING_SPEED = 0.01
"""v_s of the smoothed sign tanh(v/v_s) [rad/s]: the paper smooths it too, and does not say how much."""
KICK = 0.05
"""Speed with which the joint is let go [rad/s]: a tenth of what the logs hold, soon stopped by its friction."""
DURATION, LATE = 3.0, 1.5
"""The joint floats for so long, and is evaluated from `LATE` on [s]."""


@dataclass(frozen=True)
class Reversal:
    """One joint on the piecewise model, around a reversal.

    Attributes:
        joint: Which.
        step: Half the step of the model at zero speed [rad].
        friction: What it should undo there: dead zone and Coulomb friction [rad].
        spectral_radius: Of the loop linearised at the reversal, sliding.
        time, speed: (T,) of the joint that floats on the model [s], [rad/s].
        other_speed: (T,) of the same joint on the asymmetric linear model.
    """

    joint: str
    step: float
    friction: float
    spectral_radius: float
    time: FloatArray
    speed: FloatArray
    other_speed: FloatArray

    @property
    def late_speed(self) -> float:
        """RMS speed from `LATE` on [rad/s]."""
        return float(np.sqrt(np.mean(self.speed[self.time >= LATE] ** 2)))

    @property
    def late_other_speed(self) -> float:
        """The same on the linear model."""
        return float(np.sqrt(np.mean(self.other_speed[self.time >= LATE] ** 2)))


class PiecewiseFeedforward(LeafSystem):
    """command = q + s f+(tau_g) + (1 - s) f-(tau_g),  s = (1 + tanh(vhat/v_s))/2, for one joint.

    Inputs: joint_estimate (3): [q; qdot; qddot]; position (1): q now [rad].
    Output, with direct feedthrough, no state: command (1) [rad]. tau_g: gravity at the estimate [N m].
    """

    def __init__(self, robot: Robot, law: Any) -> None:
        """Declare ports; `law` maps (torque, speed) to effort."""
        super().__init__()
        self._terms, self._law = DynamicsTerms(replace(robot, force_torque=())), law
        terms = self._terms
        self._scratch: Any = self.DeclareCacheEntry(
            "scratch",
            ValueProducer(allocate=lambda: Value(terms.create_scratch()), calc=lambda context, value: None),
            {self.nothing_ticket()},
        )
        self._estimate: Any = self.DeclareVectorInputPort("joint_estimate", 3)
        self._position: Any = self.DeclareVectorInputPort("position", 1)
        tickets = {self._estimate.ticket(), self._position.ticket()}
        self.DeclareVectorOutputPort("command", 1, self._write, tickets)

    def _write(self, context: Context, vector: BasicVector) -> None:
        estimate, scratch, rest = self._estimate.Eval(context), self._scratch.Eval(context), np.zeros(1)
        self._terms.place(scratch, estimate[:1], rest)
        torque = self._terms.forces(scratch, rest)
        vector.SetFromVector(self._position.Eval(context) + self._law(torque, estimate[1:2]))


def smoothed(fit: PiecewiseFit) -> Any:
    """(torque (T,), speed (T,)) to effort (T,), switched by tanh(v/v_s)."""

    def law(torque: FloatArray, speed: FloatArray) -> FloatArray:
        share = 0.5 * (1.0 + np.tanh(speed / SWITCHING_SPEED))
        return np.asarray(share * fit.forward(torque) + (1.0 - share) * fit.backward(torque))

    return law


def piecewise_fits(joints: tuple[str, ...], seed: int = 0) -> dict[str, PiecewiseFit]:
    """The model of each joint, from the paper's own experiment (module `identification`)."""
    rig = parse_rig({"joints": list(joints), "drive": "position_servo", "load": "torque"})
    with TemporaryDirectory() as folder:
        files = []
        for name in ("motion", "pushes"):
            scenario = experiment_scenarios(seed)[name]
            recording = simulate_scenario(scenario)
            columns = log_columns(recording, off_line_torque(recording, scenario.dt))
            files.append(write_log(columns, Path(folder) / f"{name}.npz"))
        runs = load_runs(files, rig)
        fits = {}
        for joint in joints:
            samples = prepare(runs, rig, joint)
            ways = (samples.velocity > SWITCHING_SPEED, samples.velocity < -SWITCHING_SPEED)
            fits[joint] = PiecewiseFit(*(_three_pieces(samples.torque[way], samples.effort[way]) for way in ways))
    return fits


def reversals(joints: tuple[str, ...], seed: int = 0) -> dict[str, Reversal]:
    """Every joint by itself."""
    scenario = diagram_entry("hrp2_leg").scenario("float")
    return {joint: reversal(scenario, joint, fit, seed) for joint, fit in piecewise_fits(joints, seed).items()}


def _three_pieces(torque: FloatArray, effort: FloatArray) -> ThreePieces:
    """Fitted from the thirds of the torques: the paper's start at +/- 0.5 N m leaves pieces of loaded joints empty."""
    low, high = np.quantile(torque, [1.0 / 3.0, 2.0 / 3.0])
    return fit_three_pieces(torque, effort, breaks=(float(low), float(high)))


def reversal(scenario: Scenario, joint: str, fit: PiecewiseFit, seed: int = 0) -> Reversal:
    """Let one joint go with a small speed, on the piecewise and on the scenario's own (linear) model.

    Args:
        scenario: Of the whole leg; its posture, drives, sensors and filters are taken.
        joint: Which.
        fit: Its piecewise model.
        seed: Of the encoder's noise.
    """
    robot = loop_robot(scenario)
    true = actuator_models(scenario, robot)[joint]
    linear = joint_loops(scenario)[joint]
    torque = np.array([_gravity(alone(robot, scenario, joint))])
    jump = 0.5 * float((fit.forward(torque) - fit.backward(torque))[0])
    slope = 0.5 * float(sum((f(torque + 0.5) - f(torque - 0.5))[0] for f in (fit.forward, fit.backward)))
    without_feedback = replace(linear, kp=0.0, ks=0.0, kd=0.0, ki=0.0, gravity_stiffness=0.0, sensed_gravity=0.0)
    at_reversal = replace(without_feedback, k_tau_model=max(slope, 1e-9), k_v_model=jump / SWITCHING_SPEED)
    values = {value.key: value.parameters for value in true.effects}
    friction = values["deadzone"]["deadzone"] + true.drive.gain * values["coulomb"]["coulomb"]

    def plain(tau: FloatArray, speed: FloatArray) -> FloatArray:
        return np.asarray(linear.k_tau_model * tau + linear.k_v_model * speed)

    runs = [_floated(alone(robot, scenario, joint), scenario, joint, law, seed) for law in (smoothed(fit), plain)]
    radius = at_reversal.spectral_radius()
    return Reversal(joint, jump, friction, radius, runs[0][0], runs[0][1], runs[1][1])


def _gravity(robot: Robot) -> float:
    terms = DynamicsTerms(replace(robot, force_torque=()))
    scratch = terms.create_scratch()
    terms.place(scratch, robot.posture, np.zeros(1))
    return float(terms.forces(scratch, np.zeros(1))[0])


def _floated(robot: Robot, scenario: Scenario, joint: str, law: Any, seed: int) -> tuple[FloatArray, FloatArray]:
    """(time, speed) of the joint alone on a feedforward."""
    builder = DiagramBuilder()
    plant: Any = builder.AddNamedSystem("plant", MultibodyPlant(scenario.plant_step))
    add_robot(plant, robot)
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    models = {joint: actuator_models(scenario, loop_robot(scenario))[joint]}
    spec = sensor_suite(scenario).encoder
    sampling = Sampling(scenario.dt, seed=sensor_seed(seed, "encoder"))
    encoder = add_encoder(builder, plant, robot, spec, sampling)
    smooth = builder.AddNamedSystem(
        "filter", SavitzkyGolayFilter(1, scenario.filters.window, scenario.filters.encoder_order, scenario.dt)
    )
    control = builder.AddNamedSystem("control", PiecewiseFeedforward(robot, law))
    actuators = add_actuators(builder, plant, models, scenario.plant_step)
    reading = encoder.GetOutputPort("reading")
    builder.Connect(reading, smooth.GetInputPort("signal"))
    builder.Connect(smooth.GetOutputPort("estimate"), control.GetInputPort("joint_estimate"))
    builder.Connect(reading, control.GetInputPort("position"))
    builder.Connect(control.GetOutputPort("command"), actuators.GetInputPort("command"))
    log = LogVectorOutput(plant.get_state_output_port(), builder, scenario.dt)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    own = plant.GetMyMutableContextFromRoot(context)
    plant.SetVelocities(own, np.array([KICK]))
    actuators.set_initial_velocity(actuators.GetMyMutableContextFromRoot(context), np.array([KICK]))
    simulator.Initialize()
    simulator.AdvanceTo(DURATION)
    found = log.FindLog(context)
    return np.array(found.sample_times()), np.array(found.data())[1].copy()
