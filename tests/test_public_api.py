"""The front door, and that nothing public is left without a word."""

import importlib
import inspect
import pkgutil
import resource
import subprocess
import sys
from collections.abc import Iterator
from types import ModuleType

import pytest

import drake_tc
from tests.benchmarks.times.machine import require

FRONT_DOOR = {
    "LIBRARY",
    "ActuatorModel",
    "ActuatorPlant",
    "CSpec",
    "CallbackLink",
    "CommandGuard",
    "CompensationSpec",
    "ControllerStepper",
    "DrakeTcError",
    "Drive",
    "EffectValue",
    "FaultMonitor",
    "FilterSpec",
    "GuardSpec",
    "InverseDynamics",
    "JointTorqueEstimator",
    "Law",
    "LcmLink",
    "LcmRobot",
    "LimitKind",
    "ModelHealth",
    "ModelMonitor",
    "ModelMonitorSpec",
    "MomentumResidual",
    "MonitorSpec",
    "RealTimeLoop",
    "RealTimeSpec",
    "Rig",
    "Robot",
    "RobustTsid",
    "Run",
    "SavitzkyGolayFilter",
    "SensorFault",
    "SensorSpec",
    "SensorSuiteSpec",
    "SeriesElasticLoopSpec",
    "SimulatedRobot",
    "Sinusoid",
    "TaskKind",
    "TorqueControl",
    "TorqueGains",
    "TorqueLoopSpec",
    "TorqueModel",
    "WholeBodySpec",
    "actuator_model",
    "add_actuators",
    "add_joint_actuators",
    "add_model_monitor",
    "add_robot",
    "add_robot_plant",
    "add_sensors",
    "add_series_elastic_loop",
    "add_torque_loop",
    "add_whole_body_loop",
    "block_graph",
    "channel",
    "close_loop",
    "compare",
    "constant_trajectory",
    "effect",
    "feedforward_effort",
    "fuse",
    "health_of",
    "identify",
    "joint_limits",
    "knot_trajectory",
    "linearise",
    "load_law",
    "load_models",
    "load_rig",
    "load_robot",
    "load_run",
    "load_runs",
    "loop_margins",
    "open_loop",
    "register_effect",
    "register_limit",
    "register_task",
    "save_models",
    "series_elastic_controller",
    "simulated_inertia",
    "sinusoid_trajectory",
    "sliding",
    "swept_sine",
    "to_c",
    "torque_controller",
    "whole_body_controller",
}


def modules() -> list[str]:
    names = ["drake_tc", "drake_tc.diagrams", "drake_tc.models"]
    for package in (drake_tc, importlib.import_module("drake_tc.diagrams")):
        names += [info.name for info in pkgutil.walk_packages(package.__path__, package.__name__ + ".")]
    return sorted(set(names))


def test_the_front_door_is_what_stands_on_the_list():
    assert set(drake_tc.__all__) == FRONT_DOOR
    assert set(dir(drake_tc)) >= FRONT_DOOR
    for name in drake_tc.__all__:
        assert getattr(drake_tc, name) is not None


def test_an_unknown_name_lists_those_there_are():
    with pytest.raises(AttributeError, match=r"no 'ActuatorModle'.*ActuatorModel"):
        _ = drake_tc.ActuatorModle


@pytest.mark.benchmark
def test_importing_the_package_is_quick():
    def seconds(code: str) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, "-c", code], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    require({"import drake_tc": 0.2}, lambda: {"import drake_tc": seconds("import drake_tc") - seconds("pass")})


def test_every_module_imports_and_every_public_thing_is_documented():
    assert [thing for name in modules() for thing in without_docstring(importlib.import_module(name))] == []


def without_docstring(module: ModuleType) -> Iterator[str]:
    """The module, its public functions and classes, and the methods of these."""
    if not inspect.getdoc(module):
        yield module.__name__
    for key, value in vars(module).items():
        if key.startswith("_") or getattr(value, "__module__", None) != module.__name__:
            continue
        where = f"{module.__name__}.{key}"
        if (inspect.isfunction(value) or inspect.isclass(value)) and not value.__doc__:
            yield where
        if inspect.isclass(value):
            own = {
                k: v
                for k, v in vars(value).items()
                if not k.startswith("_") and getattr(v, "__name__", "") != "<lambda>"
            }
            plain = {k: v.fget if isinstance(v, property) else v for k, v in own.items()}
            yield from (f"{where}.{k}" for k, v in plain.items() if inspect.isfunction(v) and not inspect.getdoc(v))


def test_errors_share_one_root():
    errors = importlib.import_module("drake_tc.errors")
    classes = [value for value in vars(errors).values() if inspect.isclass(value)]
    assert len(classes) >= 5
    assert all(issubclass(value, drake_tc.DrakeTcError) for value in classes)
