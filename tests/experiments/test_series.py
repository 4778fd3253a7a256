"""A series: error against what changes, photographs beside twins."""

import csv
import json
import re
import shutil

import numpy as np
import pytest

from experiments.series import series, series_page, series_rows
from lab.options import Place, Settings
from scene.errors import SceneError
from tests.conftest import FIXTURE

STATISTICS = ("min_deg", "max_deg", "mean_deg", "median_deg", "std_deg")


def write(folder, name, real, twin):
    """Write a summary of one method, with these mean errors."""
    row = {kind: dict.fromkeys(STATISTICS, error) for kind, error in (("real", real), ("twin", twin)) if error}
    row |= {"median_difference_low_deg": real - 1, "median_difference_high_deg": real + 1}
    (folder / name).mkdir()
    (folder / name / "summary.json").write_text(json.dumps({"compare": {"methods": {"ls": row}}}))


def test_photographs_stand_beside_twins_in_the_order_of_the_factor(tmp_path):
    for name, real, twin in (("c", 5.0, 4.0), ("a", 1.25, 1.0), ("b", 3.0, 2.5)):
        write(tmp_path, name, real, twin)
    rows = series_rows(tmp_path, {"c": 1600, "a": 100, "b": 400})
    assert [(row["session"], row["value"], row["frames"], row["mean_deg"]) for row in rows] == [
        ("a", 100, "real", 1.25), ("a", 100, "twin", 1.0), ("b", 400, "real", 3.0), ("b", 400, "twin", 2.5),
        ("c", 1600, "real", 5.0), ("c", 1600, "twin", 4.0),
    ]  # fmt: skip
    page = series_page("penguin <1>", "iso", rows)
    for words in ("rank alike to 1.00", "iso: 100, 400, 1600", "penguin &lt;1&gt;", "1.25"):
        assert words in page
    upside_down = [{**row, "mean_deg": (-1 if row["frames"] == "twin" else 1) * row["mean_deg"]} for row in rows]
    assert "rank alike to -1.00" in series_page("penguin", "iso", upside_down)


def test_what_is_not_known_is_said(tmp_path):
    write(tmp_path, "a", 1.0, None)
    (tmp_path / "b").mkdir()
    rows = series_rows(tmp_path, {"a": "matte", "b": "satin"})
    assert [row["session"] for row in rows] == ["a"]
    assert "rank alike to not known" in series_page("penguin", "paint", rows)
    assert "No session has a ground truth" in series_page("penguin", "paint", [])


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        (['[series]\nfactor = "iso"\nvalue = 100'], "found fewer than two sessions"),
        (['[series]\nfactor = "iso"\nvalue = 100', ""], "1: has no [series]"),
        (['[series]\nfactor = "iso"\nvalue = 1', '[series]\nfactor = "gain"\nvalue = 2'], "the factors gain, iso"),
        (['[series]\nfactor = "iso"\nvalue = 1', '[series]\nfactor = "iso"\nvalue = "two"'], "some are words"),
        (['[series]\nfactor = "iso"\nvalue = 1', '[series]\nfactor = "iso"\nvalue = 1'], "have the value 1"),
    ],
)
def test_what_is_no_series_is_refused_before_anything_is_made(tables, words, tmp_path):
    for number, text in enumerate(tables):
        (tmp_path / "in" / str(number)).mkdir(parents=True)
        (tmp_path / "in" / str(number) / "session.toml").write_text(f'[frames]\nflash = "*.png"\n{text}\n')
        for frame in range(3):
            (tmp_path / "in" / str(number) / f"{frame}.png").write_bytes(b"")
    with pytest.raises(SceneError, match=re.escape(words)):
        series(tmp_path / "in", place=Place(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


@pytest.mark.full
@pytest.mark.render
def test_fewer_photographs_err_more_on_both(tmp_path):
    """The fixture's twelve flashes, and four of them: nothing is given but photographs, balls and scan."""
    text = (FIXTURE / "session.toml").read_text()
    for count in (4, 12):
        folder = tmp_path / "in" / f"{count} flashes"
        shutil.copytree(FIXTURE, folder, ignore=shutil.ignore_patterns("truth*"))
        for number in set(range(12)) - {*range(0, 12, 12 // count)}:
            (folder / "raw" / f"flash_{number:03d}.dng").unlink()
        (folder / "session.toml").write_text(f'{text}\n[series]\nfactor = "flashes"\nvalue = {count}\n')
    series(tmp_path / "in", place=Place(tmp_path / "out"), said=Settings("ls,iterative", error=0.02))
    with (tmp_path / "out" / "series.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    errors = {(row["method"], row["frames"], float(row["value"])): float(row["mean_deg"]) for row in rows}
    assert len(errors) == 2 * 2 * 2
    for kind in ("real", "twin"):
        assert errors["ls", kind, 4] > errors["ls", kind, 12]
    # What changes is in the twin as on the photographs.
    real, twin = (np.array([errors["ls", kind, count] for count in (4, 12)]) for kind in ("real", "twin"))
    assert np.abs(real / twin - 1).max() < 0.3
    assert "Fail alike?" in (tmp_path / "out" / "series.html").read_text()
