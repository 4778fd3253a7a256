"""The step `trust` on a session: what it leaves, and whether it recommends what is right."""

import json

import pytest

from tests.conftest import FIXTURE

METHODS = "ls,iterative,reflectance,near"


@pytest.mark.full
@pytest.mark.slow
def test_the_best_method_of_a_session_is_recommended(tmp_path, run_rgbn):
    out = tmp_path / "out"
    code, printed, said = run_rgbn("solve", FIXTURE, "--out", out, "--trust", "-m", METHODS)
    assert code == 0, said
    found = json.loads((out / "summary.json").read_text())["trust"]
    # As against the registered scan: docs/evidence/methods.md.
    assert list(found["methods"]) == ["reflectance", "near", "iterative", "ls"]
    assert found["recommended"] == "reflectance"
    assert not found["doubts"]
    assert "method reflectance is best" in " ".join(printed.split())
    # Asked again without it, what was judged stays with the solution that it is of.
    code, _, _ = run_rgbn("solve", FIXTURE, "--out", out, "-m", METHODS)
    assert code == 0
    assert json.loads((out / "summary.json").read_text())["trust"]["recommended"] == "reflectance"
    # Another solution, not asked for it, makes it old.
    code, _, _ = run_rgbn("solve", FIXTURE, "--out", out, "-m", "ls", "--no-trust")
    assert code == 0
    assert json.loads((out / "summary.json").read_text())["trust"] is None
