"""The loop over seeds of the benchmarks on simulated rigs."""

from pathlib import Path

import pytest

from tests.benchmarks.seeds import by_seed


@pytest.mark.parametrize(
    ("seeds", "folders"),
    [
        (None, {0: "."}),
        ([7], {7: "."}),
        ([3, 1, 3], {3: "seed_3", 1: "seed_1"}),
    ],
)
def test_each_seed_runs_once_and_several_have_folders_of_their_own(tmp_path, seeds, folders):
    found = by_seed("bench", seeds, tmp_path, 1, lambda folder, seed, pool, report: (folder, seed), quiet=True)
    assert list(found) == list(folders)
    assert found == {seed: (tmp_path / name, seed) for seed, name in folders.items()}


def test_without_a_folder_files_go_to_a_scratch_folder_that_is_removed():
    def run(folder, seed, pool, report):
        (folder / "log.csv").write_text("time\n", encoding="utf-8")
        return folder

    folder: Path = by_seed("bench", None, None, 1, run, quiet=True)[0]
    assert not folder.exists()


STAGE = {4: "reading", 5: "fitting"}


def test_progress_of_all_seeds_together_is_told_on_stderr(capsys):
    by_seed("bench x", [4, 5], None, 1, lambda folder, seed, pool, report: report(STAGE[seed], 0.5), quiet=False)
    assert capsys.readouterr().err.splitlines() == ["bench x: seed 4: reading", "bench x: seed 5: fitting"]
