"""What is joined from cells: tables that are the same bytes in any order, statistics that lose no failure, charts."""

import json
import re

import numpy as np
import pytest
from pyarrow import parquet

from experiments.catalogue import CALIBRATED, EXPERIMENTS, SOLVERS
from experiments.sweeps.cell import failed_rows
from experiments.sweeps.sweep import write_tables
from experiments.sweeps.sweep_page import write_page
from experiments.sweeps.sweep_statistics import benchmark_statistics, curve, rank_correlation, statistics
from experiments.tables import KEY, RESULTS


def cells_with(error, experiments=EXPERIMENTS):
    """Made-up cells whose mean error is `error(experiment, solver, level)`; None: failed."""
    found = []
    for name in experiments:
        for cell in EXPERIMENTS[name].cells():
            rows = failed_rows(cell, "by the test")
            for row in rows:
                value = error(name, row["solver"], row["level"])
                if value is not None:
                    row |= {"status": "ok", "mean_deg": float(value), "median_deg": float(value)}
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
    order = [*EXPERIMENTS, *SOLVERS]
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
    rows = [{**row, "status": row["status"].replace("failed", "no answer")} for row in rows]
    numbers = statistics(rows)["roughness", "ls", "default"]
    assert (numbers["cells"], numbers["no_answer"], numbers["failed"]) == (24, 3, 0)
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
    assert rank_correlation(statistics(rows), "seed") == (pytest.approx(1.0), 9 * len(CALIBRATED))
    rows = [row for one in cells_with(lambda n, s, _: 1 / theirs[n, s]["mean"]) for row in one["rows"]]
    assert rank_correlation(statistics(rows), "default")[0] == pytest.approx(-1.0)
    assert np.isnan(rank_correlation({}, "seed")[0])


def test_the_page_shows_failures_and_every_experiment(tmp_path):
    found = cells_with(lambda name, solver, level: None if solver == "tv" else level + 1.0)
    # Each solver half as fast as the one before.
    for one in found:
        one["seconds"] += [
            {name: row[name] for name in (*KEY,)} | {"seconds": 2.0 ** list(SOLVERS).index(row["solver"])}
            for row in one["rows"]
        ]
    rows, perturbed, seconds = write_tables(tmp_path, found, [*EXPERIMENTS, *SOLVERS])
    write_page(tmp_path, rows, found, perturbed=perturbed, seconds=seconds)
    page = (tmp_path / "index.html").read_text()
    for one in EXPERIMENTS.values():
        assert f"<h2>{one.label}</h2>" in page
        chart = (tmp_path / f"{one.name}-normals.svg").read_text()
        assert chart.count("<polyline") == len(SOLVERS)
        assert chart.count("<polygon") == len(SOLVERS)
        assert not re.search(r"\bnan\b", chart)
        speed = (tmp_path / f"{one.name}-speed.svg").read_text()
        # Six methods that have results, with two profiles each.
        assert speed.count("s per megapixel-image, median") == 12
    assert "tv, default: failed: by the test" in page
    assert "ls, default: 7.81 s per megapixel-image" in (tmp_path / "speed.svg").read_text()
    atlas = (tmp_path / "atlas.svg").read_text()
    assert "tv, default" not in atlas, "what failed says nothing of the method"
    assert json.loads((tmp_path / "stability.json").read_text())["doubts"][0]["whole_doubted"] > 0
    assert "0 / 0 / 24 / 0 %" in page
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "")
