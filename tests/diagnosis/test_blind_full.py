"""The whole blind benchmark (`drake-tc bench diagnosis --scale full`): the figures that the README quotes."""

import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest

from drake_tc.bench.blind_rigs import blind_benchmark
from drake_tc.blind.scoreboard import print_score


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_the_full_catalogue(tmp_path):
    with ProcessPoolExecutor(os.cpu_count() or 1, mp_context=get_context("spawn")) as pool:
        score = blind_benchmark(tmp_path, "full", 0, pool, lambda text, share: None)
    print_score(score)
    shares = {row.name: row for row in score.rows}
    singles = [o for o in score.outcomes if o.group == "single" and o.strength == "middle"]
    nulls = [o for o in score.outcomes if o.group == "null"]
    pairs = [o for o in score.outcomes if o.group == "pair"]
    outside = [o for o in score.outcomes if o.group == "outside"]
    assert len(singles) >= 70, sorted(shares)
    assert len(nulls) >= 40
    assert sum(o.first_right for o in singles) >= 0.90 * len(singles)
    assert sum(o.exact for o in singles) >= 0.90 * len(singles)
    assert sum(bool(o.named) for o in nulls) <= 0.03 * len(nulls)
    assert sum(o.all_found for o in pairs) >= 0.85 * len(pairs)
    assert sum(o.structured for o in outside) >= 0.90 * len(outside)
