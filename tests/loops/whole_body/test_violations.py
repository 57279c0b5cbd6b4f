"""What counts as a broken limit, on recordings made by hand: closed forms of cones, in whichever axes they stand."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.loops.whole_body.references import SpanSpec
from drake_tc.loops.whole_body.running import (
    TsidRecording,
    contact_misses,
    contact_wrenches,
    joint_misses,
    worst_misses,
)
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.robot.plant import joint_limits
from drake_tc.tsid.configuration import load_law

FILE = Path(__file__).resolve().parents[3] / "models" / "hrp2_like" / "hrp2_like_tsid.yaml"
TILT, FRICTION, LEAST = 0.7, 0.5, 20.0
M = FRICTION * np.sqrt(0.5)
TURN = np.array([[np.cos(TILT), 0.0, np.sin(TILT)], [0.0, 1.0, 0.0], [-np.sin(TILT), 0.0, np.cos(TILT)]])


def recorded(axes, forces, lifted=None):
    """The robot at rest on two points under its feet, their frames tilted; (T, 6) forces in the world push on it."""
    place = {"kind": "point", "xyz": [0.0, 0.0, -0.05], "rpy": [0.0, TILT, 0.0], "friction": FRICTION, "axes": axes}
    points = {name: {**place, "link": f"{name[0]}_foot", "minimum_force": LEAST} for name in ("right", "left")}
    changes = {"contacts": {"right_sole": None, "left_sole": None, **points}, "tasks": {"force": None}}
    law = load_law(FILE, changes)
    model = law.model
    terms = model.terms(model.create_scratch(), model.start, np.zeros(model.nv))
    for contact in model.contacts:
        assert_allclose(terms.pose(contact.name)[0], TURN, atol=1e-9)
    whole = np.vstack([terms.frame(contact.name).jacobian[3:] for contact in model.contacts])
    time = 1e-3 * np.arange(len(forces))
    state = np.tile(np.concatenate((model.start, np.zeros(model.nv))), (len(forces), 1))
    signals = {
        "state": state,
        "contact": forces @ whole,
        "applied_torque": np.zeros((len(forces), model.n)),
        "contact_force": np.zeros((len(forces), 6)),
    }
    scenario = TsidScenario(controller=str(FILE), duration=float(time[-1]), lifted=lifted or {})
    return TsidRecording(scenario=scenario, law=law, constraints=(), time=time, signals=signals, seconds=1.0, fell=None)


def expected(force):
    """By the pyramid written out, in the axes of the cone."""
    x, y, z = np.asarray(force).T
    return np.max([np.abs(x) - M * z, np.abs(y) - M * z, LEAST - z], axis=0)


def pushes(count=40):
    rng = np.random.default_rng(0)
    forces = rng.normal(size=(count, 6)) * [60.0, 20.0, 40.0, 60.0, 20.0, 40.0] + [0.0, 0.0, 250.0, 0.0, 0.0, 250.0]
    forces[0] = [0.0, 0.0, 280.0, 0.0, 0.0, 280.0]
    return forces


@pytest.mark.parametrize("axes", ["world", "link"])
def test_forces_come_back_in_the_axes_of_their_contacts(axes):
    forces = pushes()
    found = contact_wrenches(recorded(axes, forces)).reshape(-1, 2, 3)
    assert_allclose(found, forces.reshape(-1, 2, 3) @ (TURN if axes == "link" else np.eye(3)), atol=1e-8)


@pytest.mark.parametrize("axes", ["world", "link"])
def test_a_cone_is_judged_in_the_axes_in_which_the_controller_keeps_it(axes):
    forces = pushes()
    in_cone = forces.reshape(-1, 2, 3) @ (TURN if axes == "link" else np.eye(3))
    worst = np.max([expected(in_cone[:, 0]), expected(in_cone[:, 1])], axis=0)
    assert np.count_nonzero(worst > 0.0) > 0
    assert (worst[0] > 0.0) == (axes == "link")  # straight up: inside a cone that stands, outside one that leans
    assert_allclose(contact_misses(recorded(axes, forces)), worst, atol=1e-8)
    assert_allclose(contact_misses(recorded(axes, forces), every=3), worst[::3], atol=1e-8)


def test_what_is_lifted_does_not_count_and_what_lasts_does():
    forces = pushes()
    lifted = {"right": (SpanSpec(0.01, 0.02),)}
    both, left = (expected(forces[:, part]) for part in (slice(0, 3), slice(3, 6)))
    worst = np.maximum(both, left)
    worst[10:20] = left[10:20]
    assert_allclose(contact_misses(recorded("world", forces, lifted)), worst, atol=1e-8)
    means = np.array([forces[k - 2 : k + 3].mean(axis=0) for k in range(2, 38)])
    worst = np.maximum(expected(means[:, :3]), expected(means[:, 3:]))
    assert_allclose(contact_misses(recorded("world", forces), window=5)[2:-2], worst, atol=1e-8)


def test_the_worst_joint_counts():
    recording = recorded("world", pushes())
    model = recording.law.model
    limits, state = joint_limits(model.robot), recording["state"]
    state[5, model.positions[3]] = limits.upper[3] + 0.2
    state[6, model.positions[4]] = limits.lower[4] - 0.1
    state[7, model.nq + model.actuated[2]] = -limits.velocity[2] - 0.3
    recording["applied_torque"][8, 1] = -limits.effort[1] - 4.0
    misses = joint_misses(recording)
    assert_allclose([misses["position"][5], misses["position"][6]], [0.2, 0.1], atol=1e-12)
    assert_allclose([misses["velocity"][7], misses["torque"][8]], [0.3, 4.0], atol=1e-9)
    assert {name: np.flatnonzero(missed > 0.0).tolist() for name, missed in misses.items()} == {
        "position": [5, 6],
        "velocity": [7],
        "torque": [8],
    }
    worst = worst_misses(recording, since=0.0)
    assert_allclose([worst["position"], worst["velocity"], worst["torque"]], [0.2, 0.3, 4.0], atol=1e-9)
