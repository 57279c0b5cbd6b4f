"""`bench diagnosis` in parts and over several seeds; a rig that is refused, or on which the tool fails, is counted."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from drake_tc.errors import DrakeTcError
from drake_tc.joint_simulator.spec import BlindError
from tests.benchmarks import blind_rigs
from tests.benchmarks.blind.catalogue import catalogue
from tests.benchmarks.blind_rigs import BlindOptions, blind_benchmark, diagnose_folder

SILENT = lambda text, share: None  # noqa: E731


def test_parts_of_the_benchmark_keep_the_names_of_the_whole() -> None:
    whole = {spec.name: spec for spec in catalogue("full", 4)}
    parts = [BlindOptions("full", (group,)).chosen(4) for group in ("nulls", "singles", "pairs", "outside")]
    assert sum(map(len, parts)) == len(whole) == len(BlindOptions("full").chosen(4))
    assert all(whole[spec.name] == spec for part in parts for spec in part)
    assert {spec.group for spec in BlindOptions("full", ("nulls", "pairs")).chosen(4)} == {"null", "pair"}
    chosen = BlindOptions("full", ("outside",), ("touch", "detent")).chosen(4)
    assert len(chosen) == 6 and {spec.kind for spec in chosen} == {"touch", "detent"}


def test_a_choice_that_is_not_possible_is_one_clear_line() -> None:
    with pytest.raises(BlindError, match="no group 'null'; groups are nulls, singles, pairs, outside"):
        BlindOptions("smoke", ("null",)).chosen(0)
    with pytest.raises(BlindError, match=r"no kind 'stribeck' among the chosen rigs; kinds are .*touch"):
        BlindOptions("smoke", ("outside",), ("stribeck",)).chosen(0)


@pytest.mark.parametrize(
    ("error", "reason"),
    [(DrakeTcError("no motion"), "refused: no motion"), (StopIteration("x"), "failed with StopIteration: x")],
)
def test_a_rig_without_diagnosis_leaves_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, reason: str
) -> None:
    def fail(*args: object) -> None:
        raise error

    monkeypatch.setattr(blind_rigs, "close_loop", fail)
    (tmp_path / "rigs" / "rig_000").mkdir(parents=True)
    (tmp_path / "rigs" / "rig_000" / "run_sine.csv").touch()
    assert diagnose_folder(tmp_path / "rigs" / "rig_000", tmp_path / "reports") == "rig_000"
    report = json.loads((tmp_path / "reports" / "rig_000" / "report.json").read_text(encoding="utf-8"))
    assert report["joints"] == {} and report["error"] == reason


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Rigs are truths without files, none of them diagnosed; returns the names of those that were made."""
    names: list[str] = []

    def generate(specs, folder):
        for spec in specs:
            (folder / "truth" / spec.name).mkdir(parents=True)
            (folder / "rigs" / spec.name).mkdir(parents=True)
            truth = {"name": spec.name, "group": spec.group, "kind": spec.kind, "strength": spec.strength}
            text = json.dumps(truth | {"effects": [], "oracle": {"heldout": 1.0}})
            (folder / "truth" / spec.name / "truth.json").write_text(text, encoding="utf-8")
            names.append(spec.name)
        return [folder / "rigs" / spec.name for spec in specs]

    monkeypatch.setattr(blind_rigs, "generate", generate)
    return names


def test_parts_run_one_after_the_other_share_a_folder(tmp_path: Path, made: list[str]) -> None:
    with ThreadPoolExecutor(1) as pool:
        first = blind_benchmark(tmp_path, BlindOptions("smoke", ("outside",)), 2, pool, SILENT)
        assert len(made) == len(first.outcomes) == 6
        second = blind_benchmark(tmp_path, BlindOptions("smoke", ("outside", "nulls")), 2, pool, SILENT)
        assert len(made) == len(second.outcomes) == 16  # the first six were not made again
        with pytest.raises(BlindError, match=r"holds rigs of .*'seed': 2.*choose another folder"):
            blind_benchmark(tmp_path, BlindOptions("smoke", ("outside",)), 3, pool, SILENT)
    assert not any(outcome.answered for outcome in second.outcomes)
