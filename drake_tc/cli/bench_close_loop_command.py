"""`drake-tc bench close-loop`: what the whole command costs on logs of ordinary and of large size."""

import tempfile
from pathlib import Path

from drake_tc.cli.bench_seeds import AsJson
from drake_tc.cli.bench_table import print_rows
from drake_tc.cli.progress import progress_bar
from drake_tc.cli.seed_option import UnusedSeed


def bench_close_loop(
    as_json: AsJson = False,
    seed: UnusedSeed = 0,
) -> None:
    """Measure time and memory of `drake-tc close-loop` for one joint with 90 000 and with 10^6 samples."""
    from drake_tc.benchmarks.close_loop_speed import SpeedCase, cost_rows, write_runs
    from drake_tc.cli.demo import record_demo

    with tempfile.TemporaryDirectory() as scratch, progress_bar("bench close-loop", quiet=as_json) as progress:
        folders = [Path(scratch) / name for name in ("short", "long", "demo")]
        progress("recording", 0.0)
        for folder in folders:
            folder.mkdir()
        short, long = write_runs(folders[0], 30.0), write_runs(folders[1], 334.0)
        rig, logs, holdout = record_demo(folders[2], 0)
        demo = SpeedCase("90 000 samples of the demo's bench, two effects", rig, tuple(logs), tuple(holdout))
        rows = []
        for number, case in enumerate((short, demo, long)):
            progress(case.name, 0.2 + 0.25 * number)
            rows += cost_rows([case])
    print_rows("close-loop", rows, as_json=as_json)
