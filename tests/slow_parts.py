"""Parts of the slow tests, each under forty minutes on two cores: `python tests/slow_parts.py [PART ...]` runs them.

Without a part all of them run one after the other; `--list` prints them. A test belongs to the part that has a pattern
of its file and parameters (`tests/conftest.py`); every slow test belongs to exactly one.
"""

import subprocess
import sys
import time
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
REPRODUCED = "diagrams/papers/test_papers.py::test_a_reproduction_is_as_recorded?"
"""The test of whole reproductions; its parameter, an id in square brackets, follows."""


@dataclass(frozen=True)
class Part:
    """Slow tests that one kind of change can reach.

    Attributes:
        about: One line for `make help`.
        tests: Patterns of test ids below tests/, as in `fnmatch`; `?` stands for a bracket.
        alone: Whether its tests start processes of their own, or take times, and so run one by one.
    """

    about: str
    tests: tuple[str, ...]
    alone: bool = False


PARTS = {
    "leg": Part(
        "Del Prete et al. (2016): the leg's torque loop, faults, stress, tuning",
        (
            REPRODUCED + "A.fig*",
            REPRODUCED + "A.t[ao]*",
            "diagrams/papers/test_papers.py::test_another_seed*",
            "diagrams/papers/test_papers.py::test_torque_control_follows*",
            "diagrams/papers/test_papers.py::test_stability_judges*",
            "diagrams/papers/test_papers.py::test_a_force_sine*",
            "loops/fused/test_fuse.py::*",
            "loops/test_random_context.py::*",
            "loops/torque/*",
            "diagrams/papers/delprete2016/test_table1.py::*",
            "diagrams/test_other_robots.py::*",
            "analysis/*",
        ),
    ),
    "leg-sweeps": Part(
        "Del Prete et al. (2016): stability, its grid, tuning, and what goes beyond the paper",
        (REPRODUCED + "A.stability*", REPRODUCED + "A.tune?", REPRODUCED + "A.beyond?"),
        alone=True,
    ),
    "tsid": Part(
        "Del Prete and Mansard (2015): its five tests, how their motions were chosen, quadratic programs",
        (REPRODUCED + "B.test*", "diagrams/papers/delprete2015/test_reproductions.py::*", "tsid/*"),
        alone=True,
    ),
    "kernels": Part("the compiled functions run as Python (NUMBA_DISABLE_JIT=1)", ("kernels/*",)),
    "closed-loop": Part(
        "Del Prete and Mansard (2015): twenty robots in the whole chain (B.closed_loop)",
        (REPRODUCED + "B.closed_loop?",),
        alone=True,
    ),
    "humanoid": Part(
        "humanoids of several makers on a floor under robust TSID; pushes in all directions",
        ("diagrams/test_humanoid_tsid.py::*", "loops/fused/test_whole_body.py::*", "loops/whole_body/*"),
    ),
    "series-elastic": Part(
        "Faraji et al. (2015): one series-elastic joint, its laws and its motor",
        (
            *(REPRODUCED + id_ for id_ in ("C.bode?", "C.held?", "C.motor?")),
            "loops/series_elastic/*",
            "diagrams/papers/faraji2015/test_sea_laws.py::*",
            "identification/*",
        ),
    ),
    "coman-motions": Part(
        "Faraji et al. (2015): the whole loop turns, bows and slips; the base's estimate",
        (
            *(REPRODUCED + id_ for id_ in ("C.turn*", "C.genuflection?", "C.slip?", "C.soles?")),
            "diagrams/test_coman_loop.py::*",
            "estimation/base/test_motions.py::*",
        ),
    ),
    "coman-disturbed": Part(
        "Faraji et al. (2015): the whole loop is pushed, stands on one foot, loses sensors",
        (
            *(REPRODUCED + id_ for id_ in ("C.pushes?", "C.one_foot?", "C.three_contacts?", "C.faults?")),
            "diagrams/papers/faraji2015/test_pushes.py::*",
            "diagrams/papers/faraji2015/test_contacts.py::*",
            "diagrams/papers/faraji2015/test_faults.py::*",
        ),
        alone=True,
    ),
    "newcomer": Part(
        "a newcomer's path from the wheel to a report; bags to a verdict; a bag of 1 GiB",
        ("test_newcomer.py::*", "logs/bags/*"),
        alone=True,
    ),
    "commands": Part(
        "commands, pages of the documentation and plug-ins in full: every script, layout and refusal",
        ("cli/*", "docs/*", "plugin/*", "report/*", "test_doc_pages.py::*", "test_public_examples.py::*"),
    ),
    "fuzz": Part(
        "twenty thousand damaged inputs for the commands; logs with one fault",
        ("fuzz/*", "logs/test_one_fault.py::*"),
        alone=True,
    ),
    "drawn-files": Part("model files, drawn ones too, in other simulators and in ours", ("exchange/*",)),
    "diagnosis": Part(
        "small blind benchmarks, of single joints, arms and a leg; effects that resemble each other",
        (
            "benchmarks/blind/*",
            "benchmarks/test_arm_rigs.py::*",
            "benchmarks/test_gate.py::*",
            "benchmarks/test_hard_draw.py::*",
            "benchmarks/test_known_arms.py::*",
            "diagnosis/set_up/*",
            "diagnosis/problem/*",
            "diagnosis/residual/*",
            "diagnosis/robot/*",
            "diagnosis/test_blind_mini.py::*",
            "diagnosis/test_intervals.py::*",
            "diagnosis/test_joint_tolerances.py::*",
            "diagnosis/test_runs_differ.py::*",
            "diagnosis/test_shared_leg.py::*",
            "diagnosis/test_shared_leg_tolerances.py::*",
            "diagnosis/test_wrong_scales.py::*",
            "effects/*",
            "diagrams/test_one_page.py::*",
            "filtering/*",
            "loops/joint_bench/*",
        ),
    ),
    "cases": Part("the table of physical cases of the diagnosis", ("diagnosis/cases/test_cases.py::*",)),
    "experiments": Part("what checks and designs promise, held against simulated rigs", ("experiments/*",), alone=True),
    "blind-middle": Part(
        "the full blind benchmark: effects of middle strength, and pairs",
        ("diagnosis/test_blind_full.py::*?middle?",),
        alone=True,
    ),
    "blind-rest": Part(
        "the full blind benchmark: weak and strong effects, rigs without any, causes not in the library",
        ("diagnosis/test_blind_full.py::*?rest?",),
        alone=True,
    ),
    "real-data": Part(
        "public data sets; skipped where they are not there",
        ("diagnosis/test_real_*", "estimation/base/test_walking_robot.py::*", "benchmarks/test_importers.py::*"),
        alone=True,
    ),
    "notebooks": Part("the notebooks' scripts", ("test_notebooks.py::*",)),
    "times": Part("long timings; nothing else may run", ("benchmarks/times/*",), alone=True),
}


def parts_of(test: str) -> list[str]:
    """Names of the parts that a test belongs to, by its id below tests/."""
    return [name for name, part in PARTS.items() if any(fnmatchcase(test, pattern) for pattern in part.tests)]


def run(name: str) -> bool:
    """Run a part and say how long it took; whether it passed."""
    command = [sys.executable, "-m", "pytest", "-q", "-m", "slow", f"--part={name}", "--durations", "10"]
    if not PARTS[name].alone:
        command += ["-n", "2", "--dist", "worksteal"]
    begin = time.monotonic()
    passed = subprocess.run(command, cwd=ROOT, check=False).returncode == 0
    minutes = (time.monotonic() - begin) / 60.0
    print(f"slow tests, part {name}: {'passed' if passed else 'FAILED'} in {minutes:.1f} minutes", flush=True)
    return passed


def main(names: list[str]) -> int:
    """List the parts, or run those that are named, or all; the exit code."""
    if names == ["--list"]:
        print("parts of the slow tests:")
        print("\n".join(f"  make test-slow PART={name:<16} {part.about}" for name, part in PARTS.items()))
        return 0
    if unknown := sorted(set(names) - set(PARTS)):
        print(f"no part {', '.join(unknown)}; parts: {', '.join(PARTS)}", file=sys.stderr)
        return 2
    failed = [name for name in names or PARTS if not run(name)]
    if failed:
        print(f"slow tests: failed: {', '.join(failed)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
