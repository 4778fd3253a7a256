"""docs/guide/first-session.ipynb runs as it stands, and its tables hold sound numbers."""

import re
from html import unescape
from pathlib import Path

import nbformat
import pytest

NOTEBOOK = Path(__file__).parents[2] / "docs" / "guide" / "first-session.ipynb"


def test_the_notebook_is_kept_without_outputs():
    book = nbformat.read(NOTEBOOK, nbformat.NO_CONVERT)
    nbformat.validate(book)
    code = [cell for cell in book.cells if cell.cell_type == "code"]
    assert len(code) > 10
    assert not any(cell.outputs or cell.execution_count for cell in code)
    assert NOTEBOOK.stat().st_size < 20_000


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The notebook after it has run in an empty folder: its code cells by their first line."""
    from nbclient import NotebookClient

    book = nbformat.read(NOTEBOOK, 4)
    folder = tmp_path_factory.mktemp("notebook")
    NotebookClient(book, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(folder)}}).execute()
    return {cell.source.splitlines()[-1]: cell.outputs for cell in book.cells if cell.cell_type == "code"}


def shown(run, line, kind):
    """Return the data of a cell's result as a kind; the cell is named by its last line."""
    return next(output.data[kind] for output in run[line] if output.output_type == "execute_result")


def printed(run, line):
    return "".join(output.text for output in run[line] if output.get("name") == "stdout")


def table(run, line):
    """Return the rows of a cell's DataFrame by column."""
    rows = [
        [unescape(cell).strip() for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.DOTALL)]
        for row in re.findall(r"<tr[^>]*>(.*?)</tr>", shown(run, line, "text/html"), re.DOTALL)
    ]
    return [dict(zip(rows[0], row, strict=True)) for row in rows[1:]]


@pytest.mark.full
@pytest.mark.slow
def test_no_cell_fails_or_warns(run):
    for line, outputs in run.items():
        for output in outputs:
            assert output.output_type != "error", line
            assert not re.search(r"Warning|Traceback|rgbn: ", output.get("text", "")), line


@pytest.mark.full
def test_the_table_of_lights(run):
    """Twelve near lights, unit directions, in the rendered scene's distances; a sigma each."""
    rows = table(run, "session.lights.to_dataframe()")
    assert [row["name"] for row in rows] == [f"flash_{index:03d}" for index in range(12)]
    for row in rows:
        assert sum(float(row[f"direction_{axis}"]) ** 2 for axis in "xyz") == pytest.approx(1, abs=1e-4)
        assert 600 < float(row["distance_mm"]) < 1500
        assert 0 < float(row["elevation_deg"]) < 90
        assert 0 < float(row["direction_sigma_deg"]) < 1
        assert row["flags"] == ""
    for channel in "rgb":
        assert sum(float(row[f"intensity_{channel}"]) for row in rows) / 12 == pytest.approx(1, abs=1e-4)


@pytest.mark.full
def test_the_table_of_errors(run):
    rows = table(run, "session.errors.to_dataframe()")
    assert [(row["method"], row["frames"]) for row in rows] == [
        (method, frames) for method in ("ls", "iterative") for frames in ("real", "twin")
    ]
    median = {(row["method"], row["frames"]): float(row["median_deg"]) for row in rows}
    assert median["iterative", "real"] < median["ls", "real"] < 3
    for method in ("ls", "iterative"):
        assert 0.8 < median[method, "twin"] / median[method, "real"] < 1.25


@pytest.mark.full
def test_figures_texts_and_arrays_alone(run):
    figures = ("session.spheres.plot()", "session.lights.plot()", "session.errors.plot()")
    for line in (*figures, 'session.lights.plot("sigmas")'):
        assert any("image/svg+xml" in output.get("data", {}) for output in run[line]), line
    assert "iterative: normals of" in shown(run, 'session.estimate("iterative")', "text/html")
    assert "pixels have a true normal" in printed(run, next(line for line in run if "true normal" in line))
    assert printed(run, "print(session.report.relative_to(Path.cwd()))").strip() == "out/bumpy/report.html"
    said = printed(run, next(line for line in run if "median angle" in line))
    assert float(re.search(r"normals ([\d.]+) degrees", said)[1]) < 0.02
    assert shown(run, "session.warnings", "text/plain") == "0 warnings"
