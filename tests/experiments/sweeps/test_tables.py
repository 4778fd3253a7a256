"""What is joined from cells: tables that are the same bytes in any order, statistics that lose no failure, charts."""

import json
import re

import numpy as np
import pytest
from pyarrow import parquet

from experiments.stagings import CALIBRATED, ONE_FACTOR, SOLVERS
from experiments.sweeps.cell import common_means, failed_rows
from experiments.sweeps.sweep import write_tables
from experiments.sweeps.sweep_page import write_page
from experiments.sweeps.sweep_statistics import agreement, benchmark_statistics, curve, statistics
from experiments.tables import KEY, RESULTS


def cells_with(error, experiments=ONE_FACTOR):
    """Made-up cells whose mean error is `error(experiment, solver, level)`; None: failed."""
    found = []
    for name in experiments:
        for cell in ONE_FACTOR[name].cells():
            rows = failed_rows(cell, "by the test")
            for row in rows:
                value = error(name, row["solver"], row["level"])
                if value is not None:
                    row |= {"status": "ok", "median_deg": float(value)}
                    row |= dict.fromkeys(("mean_deg", "common_deg", "filled_deg"), float(value))
                    row |= {"unanswered": 0.25, "albedo_error_percent": 3.0, "pixels": 3000, "frames": 32}
                    row |= dict.fromkeys(("flip_deg", "relief_deg", "turn_deg", "tilt_spread_deg"), float(value))
                    row |= {"tilt_deg": -9.0, "doubts": "by the test"}
            key = {name: rows[0][name] for name in ("experiment", "level", "value", "label", "shape", "seed")}
            found.append(
                {"rows": rows, "seconds": [key | {"solver": "", "profile": "", "seconds": 1.5}], "picture": None}
            )
    return found


def test_tables_are_the_same_bytes_in_any_order(tmp_path):
    found = cells_with(lambda name, solver, level: len(solver) + level, ["ring", "ambient"])
    order = [*ONE_FACTOR, *SOLVERS]
    rows = write_tables(tmp_path / "a", found, order)
    shuffled = [found[i] for i in np.random.default_rng(10001).permutation(len(found))]
    assert write_tables(tmp_path / "b", shuffled, order) == rows
    assert not (tmp_path / "a" / "perturbations.parquet").exists()
    for name in ("results.parquet", "seconds.parquet"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    table = parquet.read_table(tmp_path / "a" / "results.parquet")
    assert table.column_names == list(RESULTS)
    assert table.num_rows == sum(len(one["rows"]) for one in found)
    assert table.column("experiment").to_pylist()[0] == "ambient"


def test_statistics_count_what_failed():
    errors = {0: 1.0, 1: 2.0, 2: None, 3: 6.0}
    rows = [row for one in cells_with(lambda n, s, level: errors.get(level, 3.0), ["roughness"]) for row in one["rows"]]
    numbers = statistics(rows)["roughness", "ls", "default"]
    values = np.repeat([1.0, 2.0, 6.0, 3.0, 3.0, 3.0, 3.0, 3.0], 3)
    assert (numbers["cells"], numbers["no_answer"], numbers["failed"], numbers["unanswered"]) == (24, 0, 3, 0.25)
    rows = [
        {**row, "status": "no answer: by the test", "filled_deg": 90.0} if row["status"].startswith("failed") else row
        for row in rows
    ]
    numbers = statistics(rows)["roughness", "ls", "default"]
    assert (numbers["cells"], numbers["no_answer"], numbers["failed"]) == (24, 3, 0)
    filled = statistics(rows, "filled_deg")["roughness", "ls", "default"]
    assert filled["mean"] == pytest.approx(np.append(values, [90.0] * 3).mean()), "who refuses is not rewarded"
    for name in ("min", "max", "mean", "median", "std"):
        assert numbers[name] == pytest.approx(getattr(np, name)(values))
    middle = curve(rows, "roughness", "ls", "default", "mean_deg")["middle"]
    assert np.isnan(middle[2])
    assert middle[:2] + middle[3:] == [1.0, 2.0, 6.0, *[3.0] * 5]


def test_the_benchmark_s_own_numbers():
    theirs = benchmark_statistics()
    assert len(theirs) == 9 * 7
    assert theirs["shadow", "iterative"] == {"min": 0.33, "max": 73.46, "mean": 38.30, "median": 43.24, "std": 27.95}
    assert theirs["ring", "tv"]["max"] == 97.58


def test_rank_correlation_is_that_of_ranks():
    theirs = benchmark_statistics()
    rows = [row for one in cells_with(lambda n, s, _: theirs[n, s]["mean"] ** 3) for row in one["rows"]]
    found = agreement(rows, "seed", "filled_deg")
    assert found.pairs == 9 * len(CALIBRATED)
    for one in found[1:]:
        assert one == pytest.approx((1.0, 1.0, 1.0), abs=1e-9), "all scenes of an experiment are alike here"
    rows = [row for one in cells_with(lambda n, s, _: 1 / theirs[n, s]["mean"]) for row in one["rows"]]
    assert agreement(rows, "default", "mean_deg").overall[0] == pytest.approx(-1.0)
    assert np.isnan(agreement([], "seed", "mean_deg").overall[0])


def test_agreement_within_and_between_experiments_are_told_apart():
    """The right order of methods with the experiments' difficulties upside down, and the reverse."""
    theirs = benchmark_statistics()
    mean = {name: np.mean([theirs[name, solver]["mean"] for solver in CALIBRATED]) for name in ONE_FACTOR}
    rank = sorted(mean, key=mean.get)
    opposite = dict(zip(rank, rank[::-1], strict=True))
    cells = cells_with(lambda name, solver, _: 1000 * mean[opposite[name]] + theirs[name, solver]["mean"])
    found = agreement([row for one in cells for row in one["rows"]], "seed", "filled_deg")
    assert found.within[0] == pytest.approx(1.0)
    assert found.between[0] < -0.5
    cells = cells_with(lambda name, solver, _: 1000 * mean[name] - theirs[name, solver]["mean"])
    found = agreement([row for one in cells for row in one["rows"]], "seed", "filled_deg")
    assert found.within[0] == pytest.approx(-1.0)
    assert found.between[0] > 0.5


def test_the_interval_is_wide_where_the_scenes_differ():
    theirs, generator, noise = benchmark_statistics(), np.random.default_rng(10_601), {}

    def scattered(name, solver, level):
        noise.setdefault((name, solver, level), np.exp(1.5 * generator.standard_normal()))
        return theirs[name, solver]["mean"] * noise[name, solver, level]

    found = agreement([row for one in cells_with(scattered) for row in one["rows"]], "seed", "filled_deg")
    for middle, low, high in found[1:]:
        assert -1 <= low <= middle + 0.05
        assert middle - 0.05 <= high
        assert high - low > 0.02


def test_who_leaves_out_what_is_hard_is_compared_on_what_all_answer():
    errors = np.array([[1.0, 2.0, 60.0, 70.0], [1.0, 2.0, np.nan, np.nan], [np.nan, 4.0, 5.0, 6.0], [np.nan] * 4])
    assert common_means(errors) == [2.0, 2.0, 4.0, None]
    assert common_means(errors[3:]) == [None]
    assert common_means(np.array([[1.0, np.nan], [np.nan, 1.0]])) == [None, None], "no pixel that both answer"


def test_the_page_shows_failures_and_every_experiment(tmp_path):
    found = cells_with(lambda name, solver, level: None if solver == "tv" else level + 1.0)
    # Each solver half as fast as the one before.
    for one in found:
        one["seconds"] += [
            {name: row[name] for name in (*KEY,)} | {"seconds": 2.0 ** list(SOLVERS).index(row["solver"])}
            for row in one["rows"]
        ]
    rows, perturbed, seconds = write_tables(tmp_path, found, [*ONE_FACTOR, *SOLVERS])
    write_page(tmp_path, rows, found, perturbed=perturbed, seconds=seconds)
    page = (tmp_path / "index.html").read_text()
    for one in ONE_FACTOR.values():
        assert f"<h2 id='{one.name}'>{one.label}</h2>" in page
        chart = (tmp_path / f"{one.name}-normals.svg").read_text()
        assert chart.count("<polyline") == len(SOLVERS)
        assert chart.count("<polygon") == len(SOLVERS)
        assert not re.search(r"\bnan\b", chart)
        speed = (tmp_path / f"{one.name}-speed.svg").read_text()
        # Six methods that have results, with two profiles each.
        assert speed.count("s per megapixel-image, median") == 12
    assert "tv, default: failed: by the test" in page
    assert "ls, default: 7.81 processor s per megapixel-image" in (tmp_path / "speed.svg").read_text()
    atlas = (tmp_path / "atlas.svg").read_text()
    assert "tv, default" not in atlas, "what failed says nothing of the method"
    assert json.loads((tmp_path / "stability.json").read_text())["doubts"][0]["whole_doubted"] > 0
    assert "0 / 0 / 24 / 0 %" in page
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "")
