"""The twin of a prismatic joint: no pendulum, and bristles as short as those of guides and screws."""

import numpy as np
import pytest
from few_effects import twins_show

from drake_tc.diagnosis.data.sliding import LEAST_TRAVEL
from drake_tc.errors import ParamsError
from drake_tc.experiments.rehearsal.run import ONLY_REVOLUTE, rehearse
from drake_tc.experiments.rehearsal.twin import twin_of
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import parse_rig

MASS, WEIGHT, GAIN = 12.0, 40.0, 5e-5


@pytest.fixture(scope="module")
def twin(tmp_path_factory):
    """Of a vertical axis with a position servo and a load cell."""
    time = np.arange(0.0, 15.0, 5e-3)
    rates = 2.0 * np.pi * np.array([[0.25], [0.6], [1.3]])
    sizes = np.array([[0.1], [0.04], [0.02]])
    q, v = np.sum(sizes * np.sin(rates * time), axis=0), np.sum(sizes * rates * np.cos(rates * time), axis=0)
    force = WEIGHT - MASS * np.sum(sizes * rates**2 * np.sin(rates * time), axis=0)
    rng = np.random.default_rng(0)
    goal = q + GAIN * (force + 60.0 * v + 9.0 * np.sign(v))
    columns = {
        "time": time,
        "z/position": np.round(q, 6),
        "z/position_command": goal,
        "z/torque": force + rng.normal(0.0, 0.1, time.size),
    }
    paths = [tmp_path_factory.mktemp("axis") / f"{name}.csv" for name in ("train", "held")]
    table = np.column_stack(list(columns.values()))
    for path in paths:
        np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    rig = parse_rig({"joint": "z", "joint_type": "prismatic", "drive": "position_servo", "load": "torque"})
    with pytest.MonkeyPatch.context() as patch:
        twins_show(patch, "stribeck")
        return twin_of(rig, load_runs(paths, rig), "z")


def test_the_load_of_the_twin_is_a_mass_whose_weight_does_not_follow_the_position(twin):
    joint = twin.simulator.spec.joint
    assert joint.gravity == 0.0
    assert joint.link_inertia == pytest.approx(MASS, rel=0.02)  # noise and filters change it by less


def test_its_bristles_are_wound_up_before_a_diagnosis_takes_the_samples(twin):
    assert twin.simulator.spec.joint.breakaway < 0.5 * LEAST_TRAVEL["prismatic"]


@pytest.mark.parametrize("effect_id", sorted(ONLY_REVOLUTE))
def test_effects_that_the_simulator_has_for_revolute_joints_only_are_refused(twin, effect_id):
    with pytest.raises(ParamsError, match=f"{effect_id}: the simulator has this effect for revolute joints only"):
        rehearse(twin, effect_id, 1.0, held=("held",))
