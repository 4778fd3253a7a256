"""docs/guide/first-session.ipynb runs as it stands, and its tables hold sound numbers."""

import re
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


@pytest.mark.full
@pytest.mark.slow
def test_no_cell_fails_or_warns(run):
    for line, outputs in run.items():
        for output in outputs:
            assert output.output_type != "error", line
            assert not re.search(r"Warning|Traceback|rgbn: ", output.get("text", "")), line


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
