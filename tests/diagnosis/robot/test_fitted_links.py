"""`load: {robot: fitted}` on a simulated arm of three joints: payload, rotor and link, noise floor, refusals."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from fitted_arm import COULOMB, GAIN, JOINTS, NEAR, NOISE, PAYLOAD, PLACE, RIG, ROTOR, URDF, VISCOUS, record, rig_file
from numpy.testing import assert_allclose
from robot_files import write_robot

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.run import close_loop
from drake_tc.diagnosis.shared.columns_of_runs import columns_over
from drake_tc.errors import DrakeTcError, ParamsError, RigError
from drake_tc.estimation.robot_loads import robot_logs, with_robot_loads
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from drake_tc.robot.robot import load_robot


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    loaded = load_robot(write_robot(folder, URDF, JOINTS))
    logs = [record(folder, loaded, f"run_{k}", k) for k in range(2)]
    return folder, [*logs, record(folder, loaded, "carrying", 2, PAYLOAD)], record(folder, loaded, "held", 3)


@pytest.fixture(scope="module")
def result(arm):
    folder, logs, held = arm
    rig = rig_file(folder, load=RIG["load"] | {"unknown_payload": ["carrying"]})
    return close_loop(rig, logs, [held], NEAR)


def test_an_unknown_payload_comes_out_and_nothing_else_is_named(result):
    found = result.links.payloads["carrying"]
    expected = {"m": PAYLOAD} | {f"m{axis}": PAYLOAD * PLACE[k] for k, axis in enumerate("xyz")}
    assert_allclose(found["m"].value, PAYLOAD, rtol=0.05)
    for name, value in expected.items():  # four intervals of 2.5 standard deviations hold together in 95 % of draws
        low, high = found[name].ci95
        assert abs(value - found[name].value) <= 2.5 / 1.96 * 0.5 * (high - low), name
    assert [each.id for joint in result.joints.values() for each in joint.effects] == []
    assert all(joint.links_fitted for joint in result.joints.values())


def test_intervals_hold_the_tolerance_of_the_declared_drive_gains(arm, result):
    """The gains are held, so that values stay, and all half widths h become hypot(h, c t |value|), c about 2."""
    folder, logs, held = arm
    rig = rig_file(folder, load=RIG["load"] | {"unknown_payload": ["carrying"], "drive_gain_tolerance": 0.05})
    wide = close_loop(rig, logs, [held], replace(NEAR, effects=()))  # of which none was found
    pairs = [(result.links.payloads["carrying"]["m"], wide.links.payloads["carrying"]["m"])]
    pairs += [(a.estimate, b.estimate) for a, b in zip(result.links.base, wide.links.base, strict=True)]
    pairs += [
        (each.joints["lift"].final_parameters["coulomb"]["coulomb"] for each in (result, wide)),
    ]
    for narrow, wider in pairs:
        assert_allclose(wider.value, narrow.value, rtol=1e-9, atol=1e-12)
        before, after = (0.5 * (e.ci95[1] - e.ci95[0]) for e in (narrow, wider))
        critical = np.sqrt(after**2 - before**2) / (0.05 * abs(narrow.value))
        assert 1.95 < critical < 2.1
    narrowed = [each.narrowed for each in wide.links.parameters]
    assert_allclose(narrowed, [each.narrowed for each in result.links.parameters])


def test_base_parameters_come_out_and_name_their_members(result):
    true = {f"{p.link}/{p.name}": p.declared for p in result.links.parameters}  # here the file is right
    for base in result.links.base:
        low, high = base.estimate.ci95
        value = sum(factor * true[name] for name, factor in base.weights.items())
        assert_allclose(value, base.declared, rtol=1e-9, atol=1e-12)
        assert low <= value <= high, base.name


def test_a_rotor_and_a_link_about_the_same_axis_are_not_told_apart_by_their_filters(result):
    """Nothing tells them apart at the first joint; only their sum is identified."""
    rotor = result.joints["turn"].final_parameters["rotor_inertia"]["rotor_inertia"].value
    links = {(p.link, p.name): p for p in result.links.parameters}
    column = links["column", "Izz"]
    assert_allclose(rotor, ROTOR[0], atol=0.05)
    assert column.narrowed > 0.8
    assert_allclose(column.estimate.value, column.declared, atol=0.05)


def test_friction_comes_out(result):
    for joint, viscous, coulomb in zip(JOINTS, VISCOUS, COULOMB, strict=True):
        found = result.joints[joint].final_parameters
        assert_allclose(found["viscous"]["viscous"].value, viscous, rtol=0.01)
        assert_allclose(found["coulomb"]["coulomb"].value, coulomb, rtol=0.01)


def test_noise_of_the_current_counts_in_the_floor_where_nothing_else_tells_the_load(arm):
    folder, logs, _ = arm
    rig = load_rig(rig_file(folder))
    runs = load_runs(logs, rig)
    made = with_robot_loads(robot_logs(rig, runs), runs, rig.joints)
    fitted = build_samples(made, rig, "lift")
    assert_allclose(fitted.resolution.effort_noise, NOISE * GAIN[1], rtol=0.1)
    known, felt = (
        build_samples(made, replace(rig, load=dict.fromkeys(JOINTS, RobotLoad(method))), "lift")
        for method in ("inverse_dynamics", "estimate")
    )
    assert known.floor.effort_variance == fitted.floor.effort_variance
    assert fitted.resolution.effort_tells_load and not felt.resolution.effort_tells_load
    assert felt.floor.effort_variance < 0.01 * fitted.floor.effort_variance


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"load": {"robot": "fitted", "unknown_payload": ["carying"]}}, RigError, "no log 'carying'.*carrying"),
        (
            {"load": {"robot": "fitted", "unknown_payload": ["carrying"], "payload_link": "four"}},
            RigError,
            "payload_link: no joint of the robot moves a link 'four'.*'fore'.*links: column, boom, fore",
        ),
        ({"load": {"robot": "fitted", "tolerance": -0.1}}, DrakeTcError, "tolerance"),
    ],
)
def test_refusals(arm, changes, error, message):
    folder, logs, held = arm
    with pytest.raises(error, match=message):
        close_loop(rig_file(folder, **changes), logs, [held], NEAR)


def test_a_floating_base_is_refused(arm):
    folder, logs, held = arm
    robot = yaml.safe_load((folder / "arm.yaml").read_text(encoding="utf-8")) | {"fixed_base": False}
    (folder / "floating.yaml").write_text(yaml.safe_dump(robot), encoding="utf-8")
    with pytest.raises(ParamsError, match="got a floating one"):
        close_loop(rig_file(folder, robot="floating.yaml"), logs, [held], NEAR)


@pytest.mark.slow
@pytest.mark.xfail(strict=True, reason="friction of two joints is 1.30 and 2.00 times the truth: no common scale")
def test_drives_of_unknown_gain_keep_one_scale(arm, tmp_path):
    """Nothing but the links' tolerance tells the scale, so all friction is off by one factor near 1."""
    folder, logs, held = arm
    for log in (*logs[:2], held):
        columns = dict(np.load(log))
        for joint in JOINTS:
            columns[f"{joint}/position_command"] = columns[f"{joint}/position"] + 0.01 * columns.pop(f"{joint}/current")
        np.savez(tmp_path / log.name, **columns)
    for name in ("arm.urdf", "arm.yaml"):
        (tmp_path / name).write_text((folder / name).read_text(encoding="utf-8"), encoding="utf-8")
    rig = {key: value for key, value in RIG.items() if key != "drive_gain"} | {"drive": "position_servo"}
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig), encoding="utf-8")
    runs = [tmp_path / log.name for log in logs[:2]]
    result = close_loop(tmp_path / "rig.yaml", runs, [tmp_path / held.name], NEAR)
    assert [each.id for joint in result.joints.values() for each in joint.effects] == []
    for name, true in (("viscous", VISCOUS), ("coulomb", COULOMB)):
        found = [result.joints[joint].final_parameters[name][name] for joint in JOINTS]
        ratio = np.array([e.value for e in found]) / true
        assert_allclose(ratio[1:], ratio[1], rtol=0.03)  # the first joint's scale rests on inertia alone
        assert_allclose(ratio, 1.0, atol=0.3)
        assert all(e.ci95[0] <= value <= e.ci95[1] for e, value in zip(found, true, strict=True))


def test_columns_of_the_links_give_the_load_at_every_sample(arm, tmp_path):
    """Y pi of the file's parameters is the load by the file, also where the acceleration turns within milliseconds."""
    folder, _, _ = arm
    time = np.arange(0.0, 2.0, 1e-3)
    columns = {"time": time}
    for i, joint in enumerate(JOINTS):
        shaken = np.sin(2.0 * time + i) + 1e-4 * np.sin(2.0 * np.pi * (80.0 + 7.0 * i) * time)
        columns |= {f"{joint}/position": shaken, f"{joint}/current": np.cos(time)}
    np.savez(tmp_path / "shaken.npz", **columns)
    rig = load_rig(rig_file(folder))
    runs = load_runs([tmp_path / "shaken.npz"], rig)
    logs = robot_logs(rig, runs)
    (run,) = with_robot_loads(logs, runs, rig.joints)
    causes = columns_over(logs, [run], rig)
    for joint in JOINTS:
        found = causes.of(run.name, joint, run.time - run.time[0]) @ logs.links.nominal
        assert_allclose(
            found, run.columns[f"{joint}/torque"], atol=1e-6 * float(np.std(run.columns[f"{joint}/torque"]))
        )
