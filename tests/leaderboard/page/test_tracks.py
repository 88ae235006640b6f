"""Tables of methods by tracks: numbers, colours and losses."""

from __future__ import annotations

import re

from dextron_bench.evaluation.results import Result
from dextron_bench.leaderboard.page import tracks
from dextron_bench.web.html import UNKNOWN
from tests.helpers import results as made


def result(method: str, seed: int, **scores: list[float]) -> Result:
    splits = {name.replace("_", "+", 1).replace("_", "-"): {"scores": values} for name, values in scores.items()}
    return made.result(method, seed, "synthetic", splits)


def test_cells_have_the_mean_return_and_the_loss():
    results = [
        result("a", 0, test=[20.0, 20.0], test_delay_40=[20.0, 10.0], test_bottle_mass=[0.0, 0.0]),
        result("a", 1, test=[20.0, 20.0], test_delay_40=[10.0, 10.0], test_bottle_mass=[0.0, 20.0]),
        result("b<", 0, test=[10.0, 10.0], test_delay_40=[10.0, 10.0]),
    ]
    ((reaches, split, title, matrix),) = tracks.matrices(results)
    assert (reaches, split, title) == ("synthetic", "test", "Return under tracks, test of synthetic reaches")
    heads = re.findall(r'<th scope="col">([^<]*)</th>', matrix)
    assert heads == ["return", "seeds", "plain", "delay-40", "bottle-mass", "area over delays"]
    rows = dict(re.findall(r'<th scope="row">([^<]*)</th>(.*?)</tr>', matrix))
    assert re.findall(r">([^<]+)</td>", rows["a"]) == ["2", "20.0", "12.5", "5.0", UNKNOWN]
    assert re.findall(r">([^<]+)</td>", rows["b&lt;"]) == ["1", "10.0", "10.0", UNKNOWN, UNKNOWN]
    assert re.findall(r"--rate:(\d+)%", rows["a"]) == ["100", "62", "25"]
    assert 'title="loses 7.50, 95 % interval' in rows["a"]
    assert 'title="loses 0.00, 95 % interval 0.00 to 0.00"' in rows["b&lt;"]


def test_results_without_tracks_make_no_table():
    assert list(tracks.matrices([result("a", 0, test=[20.0])])) == []
