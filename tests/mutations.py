"""Twenty faults, put into a copy of the library one at a time: `python tests/mutations.py [NAME ...]` tells which ones
the fast tests of the package find. `make mutations` runs them; a fault that passes is a test that is missing.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Fault:
    """One wrong line.

    Attributes:
        file: Below `drake_tc/`.
        right: Text that stands there once.
        wrong: What stands there instead.
        tests: Folders or files below `tests/` whose fast tests should fail.
    """

    file: str
    right: str
    wrong: str
    tests: tuple[str, ...]


FAULTS = {
    "derivative": Fault(
        "filtering/savitzky_golay.py", "(half * dt) ** derivative", "half * dt**derivative", ("filtering",)
    ),
    "regressor": Fault(
        "robot/rigid_regressor.py",
        "np.cross(p[:, :, None], force, axis=1)",
        "np.cross(force, p[:, :, None], axis=1)",
        ("robot",),
    ),
    "latency": Fault(
        "kernels/sensors.py", "ring[(tick - age) % length", "ring[(tick - age + 1) % length", ("sensing",)
    ),
    "backlash-lead": Fault(
        "kernels/torque_control.py", "joint[at.COMPLIANCE] * tau + lead", "joint[at.COMPLIANCE] * tau", ("control",)
    ),
    "ratio": Fault(
        "identification/actuator.py", "2.0 * correlation * dx", "1.0 * correlation * dx", ("identification",)
    ),
    "friction-cone": Fault("tsid/limits.py", "math.sqrt(0.5) if pyramid", "1.0 if pyramid", ("tsid",)),
    "pressure": Fault("tsid/limits.py", "(4, 1.0, -x_min,", "(4, 1.0, x_min,", ("tsid",)),
    "feedback": Fault("kernels/joint_torque.py", "out[j] + (out[2 * n + j]", "out[j] - (out[2 * n + j]", ("control",)),
    "spring": Fault(
        "estimation/link_position.py", "(deflection - held[:n])", "(deflection + held[:n])", ("estimation",)
    ),
    "errors-in-columns": Fault(
        "diagnosis/linear.py", "left = np.clip(1.0 - share,", "left = np.clip(1.0 - 0.5 * share,", ("diagnosis",)
    ),
    "held-out": Fault(
        "diagnosis/held_out.py",
        "density - density[0] - _improbable",
        "density[0] - density - _improbable",
        ("diagnosis",),
    ),
    "smallest-seen": Fault(
        "diagnosis/residual/verdict.py", "2.0 * SEEN * scored", "0.02 * SEEN * scored", ("diagnosis",)
    ),
    "stribeck": Fault("effects/stribeck.py", "2.0 * n.friction", "2e-3 * n.friction", ("effects", "diagnosis")),
    "change": Fault("watch/changes.py", "sum((np.outer(f, f)", "sum((0.0 * np.outer(f, f)", ("watch",)),
    "alarm": Fault(
        "kernels/model_monitor.py",
        "-change * white - 0.5 * change * change",
        "-change * white",
        ("sensor_validation", "watch"),
    ),
    "information": Fault(
        "experiments/log_odds.py", "self.gram = gram - crossed", "self.gram = gram + crossed", ("experiments",)
    ),
    "torque-constant": Fault("exchange/mjcf.py", "terms.damping - kt * terms.kp)", "terms.damping)", ("exchange",)),
    "temperature": Fault("logs/units.py", "-160.0 / 9.0", "-32.0", ("logs",)),
    "two-masses": Fault(
        "joint_simulator/physics.py", "(torque - load[two])", "(torque + load[two])", ("diagnosis", "benchmarks")
    ),
    "stability-axis": Fault("analysis/stability_map.py", "parts[2] + 1e-9)) + 1", "parts[2] + 1e-9))", ("analysis",)),
}
"""One for each package that computes, by its name; two or three for the large ones."""


def found(fault: Fault) -> bool:
    """Whether fast tests fail with this fault in a copy of the tree.

    Raises:
        ValueError: If the line is not there once.
    """
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        tracked = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
        for name in filter(None, tracked.split("\0")):
            if (ROOT / name).is_file():
                (tree / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, tree / name)
        path = tree / "drake_tc" / fault.file
        source = path.read_text()
        if source.count(fault.right) != 1:
            raise ValueError(
                f"expected once in {fault.file}: {fault.right}; it is there {source.count(fault.right)} times"
            )
        path.write_text(source.replace(fault.right, fault.wrong))
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-x",
            "-q",
            "-p",
            "no:cacheprovider",
            "-m",
            "not slow and not benchmark",
        ]
        command += [f"tests/{each}" for each in fault.tests]
        environment = os.environ | {"PYTHONPATH": str(tree)}
        run = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)
    if run.returncode not in (0, 1):
        raise ValueError(f"expected tests that run, got:\n{run.stdout[-2000:]}{run.stderr[-2000:]}")
    return run.returncode == 1


def main() -> int:
    """Print one line a fault; the exit status is the number of those that pass."""
    missed = 0
    for name in sys.argv[1:] or FAULTS:
        caught = found(FAULTS[name])
        missed += not caught
        print(f"{name:18} {'found' if caught else 'PASSES'}   {FAULTS[name].file}", flush=True)
    return missed


if __name__ == "__main__":
    sys.exit(main())
