"""The disturbance observer: poles where they were put, d^ = Q d of a stated Q, contacts left alone, lost inputs."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.errors import ParamsError
from drake_tc.estimation.disturbance_observer import DisturbanceObserver, JointInertia, ObserverSpec, observer_gains

from .robots import dynamics, pendulum

DT = 1e-3
ROTOR = np.array([0.6, 0.4])
VISCOUS = np.array([5.0, 3.0])


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return pendulum(tmp_path_factory.mktemp("robot"))


def models(*, rotor=True):
    def model(joint, i):
        effects = [EffectValue("viscous", {"viscous": float(VISCOUS[i])})]
        effects += [EffectValue("rotor_inertia", {"rotor_inertia": float(ROTOR[i])})] if rotor else []
        return ActuatorModel(joint, Drive("position_servo", 1e-3), tuple(effects))

    return [model(joint, i) for i, joint in enumerate(("shoulder", "elbow"))]


def observer(robot, **spec):
    return DisturbanceObserver(robot, models(), ObserverSpec(**spec), DT)


PORTS = (
    "position",
    "commanded_torque",
    "command",
    "sent_command",
    "feedforward_torque",
    "reference",
    "delayed_reference",
    "joint_estimate",
    "estimated_torque",
    "compensated_motion",
)


class Bench:
    """An observer whose inputs are set by hand."""

    def __init__(self, system):
        self.system, self.context = system, system.CreateDefaultContext()
        for name in PORTS:
            self.put(name, np.zeros(system.GetInputPort(name).size()))

    def put(self, name, value):
        self.system.GetInputPort(name).FixValue(self.context, np.asarray(value, dtype=float))

    def read(self, name):
        return np.array(self.system.GetOutputPort(name).Eval(self.context))

    def tick(self):
        self.context.SetDiscreteState(self.system.EvalUniquePeriodicDiscreteUpdate(self.context))


def advance(q, v, torque, substeps=10):
    """(q, v) a tick later of the pendulum with rotors under constant torques: Lagrange's equations, midpoint rule."""

    def rate(q, v):
        mass, bias, _ = dynamics(q, v)
        return np.linalg.solve(mass + np.diag(ROTOR), torque - bias)

    h = DT / substeps
    for _ in range(substeps):
        middle = v + 0.5 * h * rate(q, v)
        q, v = q + h * middle, v + h * rate(q + 0.5 * h * middle, middle)
    return q, v


def drive(bench, lost, outside, ticks=120, q0=(0.4, -0.7), torque=(8.0, -3.0), **puts):
    """Let the pendulum move under u less the drives' loss and a load from outside; d^ tick by tick (ticks, 2)."""
    q, v = np.array(q0), np.zeros(2)
    found = []
    for name, value in puts.items():
        bench.put(name, value)
    for _ in range(ticks):
        bias = dynamics(q, v)[1]
        bench.put("position", q)
        bench.put("compensated_motion", [*q, *v, 0.0, 0.0])
        bench.put("commanded_torque", torque)
        bench.put("feedforward_torque", bias)
        bench.put("delayed_reference", [*bias, 0.0, 0.0])
        bench.put("estimated_torque", bias + outside)
        bench.tick()
        q, v = advance(q, v, np.asarray(torque) - lost - outside)
        found.append(bench.read("disturbance"))
    return np.array(found), q, v


@pytest.mark.parametrize("bandwidth", [20.0, 250.0, 900.0])
def test_all_poles_are_where_the_bandwidth_puts_them(bandwidth):
    gains = np.array(observer_gains(bandwidth, DT))
    predict = np.array([[1.0, DT, 0.5 * DT**2], [0.0, 1.0, DT], [0.0, 0.0, 1.0]])  # q, v, acceleration that is missing
    error = predict @ (np.eye(3) - np.outer(gains, [1.0, 0.0, 0.0]))
    assert_allclose(np.poly(error), np.poly(np.full(3, np.exp(-bandwidth * DT))), rtol=1e-9, atol=1e-12)


def test_a_step_of_the_disturbance_is_found_as_a_third_order_lag_says(robot):
    bandwidth, lost = 100.0, np.array([2.0, -1.5])
    bench = Bench(observer(robot, bandwidth=bandwidth))
    found, q, v = drive(bench, lost, np.zeros(2))
    wt = bandwidth * DT * (np.arange(len(found)) + 0.5)
    share = 1.0 - np.exp(-wt) * (1.0 + wt + 0.5 * wt**2)
    assert_allclose(found, share[:, None] * lost, atol=0.05 * np.abs(lost).max())  # sampled, and b moves within a tick
    assert_allclose(found[-1], lost, rtol=0.02)
    assert np.abs(v).min() > 0.05  # it was in motion
    assert_allclose(bench.read("motion")[:4], [*q, *v], atol=2e-3)


def test_a_load_from_outside_is_not_a_disturbance(robot):
    outside = np.array([-4.0, 2.0])
    found, *_ = drive(Bench(observer(robot)), np.zeros(2), outside)
    assert np.abs(found).max() < 0.03 * np.abs(outside).max()
    bench = Bench(observer(robot))
    bench.put("delayed_reference", np.zeros(4))
    lumped, *_ = drive(bench, outside, np.zeros(2))  # the same load, which no F/T sensor reports
    assert_allclose(lumped[-1], outside, rtol=0.02)


def test_velocity_is_known_without_delay(robot):
    """A smooth motion seen through an encoder alone: no lag beyond the tick, where a filter would be 40 ms late."""
    bench = Bench(observer(robot))
    *_, v = drive(bench, np.zeros(2), np.zeros(2), ticks=200)
    assert_allclose(bench.read("motion")[2:4], v, atol=1e-3 * max(1.0, np.abs(v).max()))


def test_torque_that_the_guard_withholds_and_stale_friction_count(robot):
    """A command held back by x costs x/K; friction compensated for a velocity that is off by dv costs b dv."""
    held = np.array([1e-3, -2e-3])
    bench = Bench(observer(robot))
    found, *_ = drive(bench, held / 1e-3, np.zeros(2), command=held, sent_command=np.zeros(2))
    assert np.abs(found).max() < 0.05
    bench = Bench(observer(robot))
    q = np.array([0.3, 0.2])
    bias = dynamics(q, np.zeros(2))[1]
    stale = np.array([0.2, -0.1])
    for _ in range(100):  # a joint that rests, its loss just the friction that is compensated in vain
        for name, value in (
            ("position", q),
            ("compensated_motion", [*q, *stale, 0.0, 0.0]),
            ("commanded_torque", bias),
            ("feedforward_torque", bias),
            ("delayed_reference", [*bias, 0.0, 0.0]),
            ("estimated_torque", bias),
        ):
            bench.put(name, value)
        bench.tick()
    assert_allclose(bench.read("disturbance"), VISCOUS * stale, rtol=1e-3)


def test_rotors_that_the_model_lacks_are_fed_forward(robot):
    wanted = np.array([3.0, -2.0])
    given = {"shoulder": 0.6, "elbow": 0.4}
    bench = Bench(DisturbanceObserver(robot, models(rotor=False), ObserverSpec(), DT, rotor_inertia=given))
    bench.tick()
    bench.put("reference", [0.0, 0.0, 0.0, 0.0, *wanted])
    assert_allclose(bench.read("compensation"), ROTOR * wanted)
    bench = Bench(observer(robot))
    bench.tick()
    bench.put("reference", [0.0, 0.0, 0.0, 0.0, *wanted])
    assert_allclose(bench.read("compensation"), 0.0, atol=1e-12)  # TorqueControl does it


@pytest.mark.parametrize(
    ("name", "value"), [*((name, np.nan) for name in PORTS), ("reference", np.inf), ("position", 1e12)]
)
def test_an_input_that_is_lost_raises_the_fault_and_gives_no_compensation(robot, name, value):
    bench = Bench(observer(robot))
    assert bench.read("fault")[0] == 1.0
    drive(bench, np.array([2.0, 2.0]), np.zeros(2), ticks=15)
    assert bench.read("fault")[0] == 0.0 and np.abs(bench.read("compensation")).min() > 0.1
    sound = bench.system.GetInputPort(name).Eval(bench.context)
    bench.put(name, np.full_like(sound, value))
    bench.tick()
    assert bench.read("fault")[0] == 1.0
    for output in ("motion", "disturbance", "compensation", "link_torque"):
        assert_allclose(bench.read(output), 0.0)
    bench.put(name, sound)
    bench.tick()
    assert bench.read("fault")[0] == 0.0
    assert np.isfinite(bench.read("motion")).all()


def test_a_torque_estimate_that_has_a_fault_counts_as_lost(robot):
    bench = Bench(observer(robot))
    drive(bench, np.array([2.0, 2.0]), np.zeros(2), ticks=15)
    for fault in (1.0, 0.0):
        bench.put("torque_fault", [fault])
        bench.tick()
        assert bench.read("fault")[0] == fault


def test_the_disturbance_is_bounded(robot):
    found, *_ = drive(Bench(observer(robot, limit=0.1)), np.array([40.0, -40.0]), np.zeros(2), ticks=40)
    assert_allclose(found[-1], [5.0, -5.0])  # a tenth of 50 N m


def test_outputs_follow_what_they_say_they_follow(robot):
    system = observer(robot)
    for output in ("motion", "disturbance", "link_torque", "fault", "compensation"):
        port = system.GetOutputPort(output).get_index()
        fed = {name for name in PORTS if system.HasDirectFeedthrough(system.GetInputPort(name).get_index(), port)}
        assert fed == ({"reference"} if output == "compensation" else set())


def test_the_mass_matrix_is_lagranges(robot):
    model = JointInertia(robot)
    context = model.create_context()
    for q in ([0.0, 0.0], [0.3, -1.2], [-2.0, 2.4]):
        assert_allclose(model.mass(context, np.array(q)), dynamics(np.array(q), np.zeros(2))[0], rtol=1e-6)
    swapped = replace(robot, joints=("elbow", "shoulder"), posture=np.zeros(2))
    model = JointInertia(swapped)
    q = np.array([-1.2, 0.3])
    expected = dynamics(q[::-1], np.zeros(2))[0][::-1, ::-1]
    assert_allclose(model.mass(model.create_context(), q), expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda robot: ObserverSpec(bandwidth=0.0), "bandwidth: expected a positive number"),
        (lambda robot: ObserverSpec(limit=np.inf), "limit: expected a positive number"),
        (lambda robot: ObserverSpec(delay=-1.0), "delay: expected a number >= 0"),
        (lambda robot: ObserverSpec(torque="none"), "torque: expected one of live, filtered, got 'none'"),
        (lambda robot: DisturbanceObserver(robot, models()[:1], ObserverSpec()), "models: expected 2, one per joint"),
        (lambda robot: DisturbanceObserver(robot, models(), ObserverSpec(), 0.0), "dt: expected a positive period"),
        (
            lambda robot: DisturbanceObserver(robot, models(rotor=False), ObserverSpec()),
            "rotor_inertia: expected that of 'shoulder'",
        ),
        (
            lambda robot: DisturbanceObserver(robot, models(), ObserverSpec(), rotor_inertia={"hip": 1.0}),
            "rotor_inertia: no joint 'hip'; joints: shoulder, elbow",
        ),
        (
            lambda robot: DisturbanceObserver(robot, models(), ObserverSpec(), rotor_inertia={"elbow": -1.0}),
            "rotor_inertia.elbow: expected a positive number",
        ),
    ],
)
def test_refusals(robot, make, message):
    with pytest.raises(ParamsError, match=message):
        make(robot)
