"""Which contact approximation suits soles: a foot that stands, slides and rocks, and a robot that leans far.

The foot is held against closed forms and an ODE. It is a rigid body of 20 kg on one sole of 0.2 x 0.1 m, its centre of
mass `LOW` or `HIGH` above the sole, simulated by the same `add_ground` as every diagram, with a step of 1 ms.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource
from scipy.integrate import solve_ivp

from drake_tc.loops.recording import Progress
from drake_tc.loops.whole_body.ground import (
    APPROXIMATIONS,
    Approximation,
    GroundSpec,
    SoleSpec,
    add_ground,
    touching_points,
)
from drake_tc.loops.whole_body.running import TsidRecording, contact_misses, simulate_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.robot.fields import Mount
from drake_tc.tsid.contacts import Contact
from drake_tc.types import GRAVITY, FloatArray
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.tsid_timing import diagram_timing

MASS, LOW, HIGH = 20.0, 0.02, 0.3
"""Of the foot [kg], and the heights of its centre of mass [m]."""
GYRATION = (0.05, 0.05, 0.02)
"""Moments of inertia about the centre of mass over the mass [m^2]."""
SOLE = Contact("sole", Mount("sole", "foot"), half_length=0.095, half_width=0.045)
FRICTION = 0.5
SOFT = SoleSpec(2.0e5, dissipation=20.0)
PERIOD = 1e-3
"""Step of the plant [s]."""
REST = 1.5
"""The foot has come to rest after this long [s]."""
STICKING, SLIDING = 0.4, 1.5
"""Horizontal pushes: shares of the friction that the weight gives."""
SPEED = 0.5
"""The foot is set sliding at this speed [m/s]; it stops after v^2/(2 mu g)."""
SETTLED = 0.3
"""A robot's contact forces count from here on [s]."""
TILT, ROCKING = 0.15, 0.8
"""The foot is let go on its edge at this angle [rad] and watched for so long [s]."""


@dataclass(frozen=True, eq=False)
class Foot:
    """One foot on the floor, in a simulator."""

    simulator: Simulator
    plant: MultibodyPlant
    body: RigidBody
    context: Context

    def place(self) -> FloatArray:
        """(3,) of the sole's middle in the world [m]."""
        return np.array(self.plant.EvalBodyPoseInWorld(self.context, self.body).translation())

    def pitch(self) -> float:
        """[rad]."""
        return float(RollPitchYaw(self.plant.EvalBodyPoseInWorld(self.context, self.body).rotation()).pitch_angle())


def make_foot(spec: GroundSpec, height: float, push: float = 0.0) -> Foot:
    """A foot on the floor z = 0.

    Args:
        spec: Floor and sole.
        height: Of the centre of mass above the sole [m].
        push: Constant force along x, at the height of the floor [N].
    """
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, PERIOD)
    nothing: Any = np.zeros(3)
    centre: Any = np.array([0.0, 0.0, height])
    inertia = SpatialInertia(MASS, nothing, UnitInertia(*GYRATION)).Shift(-centre)
    body = plant.AddRigidBody("foot", inertia)
    add_ground(plant, [SOLE], spec)
    plant.Finalize()
    applied = ExternallyAppliedSpatialForce()
    applied.body_index = body.index()
    along: Any = np.array([push, 0.0, 0.0])
    applied.F_Bq_W = SpatialForce(nothing, along)
    source = builder.AddSystem(ConstantValueSource(Value([applied])))
    builder.Connect(source.get_output_port(), plant.get_applied_spatial_force_input_port())
    simulator = Simulator(builder.Build())
    return Foot(simulator, plant, body, plant.GetMyMutableContextFromRoot(simulator.get_mutable_context()))


def creep(spec: GroundSpec) -> float:
    """Speed at which a foot that should stick creeps under a push of `STICKING` times its friction [m/s]."""
    foot = make_foot(spec, LOW, STICKING * FRICTION * MASS * GRAVITY)
    foot.simulator.AdvanceTo(REST)
    before = foot.place()
    foot.simulator.AdvanceTo(2.0 * REST)
    return float(foot.place()[0] - before[0]) / REST


def stopping_distance(spec: GroundSpec) -> float:
    """Distance that a foot slides from `SPEED` on, over v^2/(2 mu g) [-]."""
    foot = make_foot(spec, LOW)
    foot.simulator.AdvanceTo(REST)
    before = foot.place()
    sliding: Any = np.array([0.0, 0.0, 0.0, SPEED, 0.0, 0.0])
    foot.plant.SetVelocities(foot.context, sliding)
    foot.simulator.AdvanceTo(REST + 4.0 * SPEED / (FRICTION * GRAVITY))
    return float(foot.place()[0] - before[0]) / (SPEED**2 / (2.0 * FRICTION * GRAVITY))


def lift_while_sliding(spec: GroundSpec) -> float:
    """How far a foot rises while a push of `SLIDING` times its friction moves it for a second [m]; none should."""
    resting = make_foot(spec, LOW)
    resting.simulator.AdvanceTo(REST)
    foot = make_foot(spec, LOW, SLIDING * FRICTION * MASS * GRAVITY)
    foot.simulator.AdvanceTo(1.0)
    return float(foot.place()[2] - resting.place()[2])


def rocking_error(spec: GroundSpec) -> float:
    """Root mean square of the tilt's error while a foot rocks from one edge to the other, against an ODE [rad]."""
    foot = make_foot(spec, HIGH)
    points = touching_points(SOLE, spec)
    upwards: Any = np.array([0.0, 0.0, spec.radius])
    centre: Any = np.array([0.0, 0.0, HIGH])
    turned = RollPitchYaw(0.0, TILT, 0.0).ToRotationMatrix()
    height = spec.radius - min((turned.matrix() @ (point + upwards))[2] for point in points)
    place: Any = np.array([0.0, 0.0, height])
    pose = RigidTransform(turned, place)
    foot.plant.SetFreeBodyPose(foot.context, foot.body, pose)
    start = pose.multiply(centre)
    times = np.arange(0.0, ROCKING + 1e-9, 0.01)
    exact = rocking(spec, float(start[0]), float(start[2]), times)
    error = []
    for instant, angle in zip(times, exact, strict=True):
        foot.simulator.AdvanceTo(instant)
        error.append(foot.pitch() - angle)
    return float(np.sqrt(np.mean(np.square(error))))


def rocking(spec: GroundSpec, x: float, z: float, times: FloatArray) -> FloatArray:
    """(T,) tilt of the foot let go at `TILT`, by the planar equations of motion [rad].

    m a = sum f - m g, I w' = sum r x f; each sphere under the sole presses with Hunt and Crossley's
    f_n = k d (1 + c d') while that is positive, d its depth, and rubs with mu f_n against its velocity.

    Args:
        spec: A floor with a soft sole.
        x: Of the centre of mass at the start, at rest [m].
        z: The same, above the floor [m].
        times: (T,) at which the tilt is desired, from 0 on [s].
    """
    sole = spec.sole or SOFT
    points = touching_points(SOLE, spec)[:, 0]
    stiffness, middle = sole.stiffness / points.size, spec.radius - HIGH

    def derivative(_: float, state: FloatArray) -> FloatArray:
        height, angle, velocity, rise, rate = state[1:]
        sine, cosine = np.sin(angle), np.cos(angle)
        along, up = cosine * points + sine * middle, cosine * middle - sine * points  # of spheres, from the centre
        depth, sinking = spec.radius - (height + up), -(rise - rate * along)
        normal = stiffness * np.maximum(depth, 0.0) * np.maximum(1.0 + sole.dissipation * sinking, 0.0)
        arm = up - spec.radius
        rubbing = -spec.friction * normal * np.tanh((velocity + rate * arm) / 1e-4)
        turning = (arm * rubbing - along * normal).sum() / GYRATION[1]
        forces: FloatArray = np.array([rubbing.sum(), normal.sum(), turning]) / MASS
        return np.concatenate([state[3:], forces - [0.0, GRAVITY, 0.0]])

    initial = [x, z, TILT, 0.0, 0.0, 0.0]
    span = (0.0, float(times[-1]))
    found = solve_ivp(derivative, span, initial, "LSODA", times, rtol=1e-8, atol=1e-10, max_step=1e-3)
    return np.asarray(found.y[2])


def cone_miss(recording: TsidRecording) -> float:
    """By how much the true contact forces, means over 10 ms, miss the controller's cones at worst, 0 if never [N]."""
    late = recording.time >= SETTLED
    return max(float(contact_misses(recording, window=10)[late].max()), 0.0)


def floor_rows(
    moved: TsidScenario,
    reaching: TsidScenario,
    progress: Progress,
    approximations: Sequence[Approximation] = tuple(APPROXIMATIONS),
) -> list[BenchmarkRow]:
    """The rows of `python -m tests.benchmarks floor`.

    Args:
        moved: Its diagram is timed.
        reaching: A robot on hard soles that leans as far as its limits allow.
        progress: Told what is measured and which share is done.
        approximations: To compare.
    """
    rows = []
    for number, approximation in enumerate(approximations):
        progress(approximation, number / len(approximations))
        hard = GroundSpec(friction=FRICTION, approximation=approximation)
        soft = GroundSpec(friction=FRICTION, approximation=approximation, sole=SOFT)
        for name, spec in (("hard floor", hard), ("soft sole", soft)):
            rows += [
                _one(f"{approximation}, {name}: creep at {STICKING:g} of the friction", "mm/s", 1e3 * creep(spec)),
                _one(f"{approximation}, {name}: stopping distance over v^2/(2 mu g)", "-", stopping_distance(spec)),
                _one(f"{approximation}, {name}: lift while sliding", "mm", 1e3 * lift_while_sliding(spec)),
            ]
        rows.append(_one(f"{approximation}, soft sole: error of a rocking tilt", "mrad", 1e3 * rocking_error(soft)))
        leaning = simulate_tsid(_on(reaching, approximation))
        rows += [
            _one(f"{approximation}, hard floor: a leaning robot's forces outside their cones", "N", cone_miss(leaning)),
            replace(diagram_timing(_on(moved, approximation)), name=f"{approximation}: a tick of the diagram"),
        ]
    return rows


def _on(scenario: TsidScenario, approximation: Approximation) -> TsidScenario:
    return scenario.changed(ground=replace(scenario.ground, approximation=approximation))


def _one(name: str, unit: str, value: float) -> BenchmarkRow:
    return BenchmarkRow(name, value, unit)
