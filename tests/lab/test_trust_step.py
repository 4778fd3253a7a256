"""The step `trust` on a session: what it leaves, and what it foretells of errors that are known."""

import json
from pathlib import Path

import numpy as np
import pytest

SESSION = Path(__file__).parents[2] / "fixtures" / "bumpy"
METHODS = "ls,iterative,reflectance,near"


@pytest.mark.full
@pytest.mark.slow
def test_errors_of_a_session_are_foretold(tmp_path, run_rgbn):
    out = tmp_path / "out"
    code, printed, said = run_rgbn("solve", SESSION, "--out", out, "--trust", "-m", METHODS)
    assert code == 0, said
    summary = json.loads((out / "summary.json").read_text())
    found = summary["trust"]
    methods = found["methods"]
    assert set(methods) == {*METHODS.split(","), "best"}
    for name, row in methods.items():
        assert row["mean_deg"] == pytest.approx(row["true"]["mean_deg"], rel=0.4), name
        # The registered scan's own doubt, some 0.2 degrees, is in the true error and not in the prediction; the more of
        # it, the smaller the error.
        assert row["true"]["within_2_sigma"] > (0.9 if row["true"]["mean_deg"] > 1.5 else 0.6), name
        predicted = np.load(out / "trust" / f"{name}.npy")
        assert predicted.shape == np.load(out / "normals" / f"{name}.npy").shape[:2]
        assert np.nanmedian(predicted) == pytest.approx(row["median_deg"], rel=0.01)
    least = min(methods, key=lambda name: methods[name]["true"]["mean_deg"] if name != "best" else 99.0)
    assert found["recommended"] == least
    assert f"take  {least}, " in printed
    # Asked again without it, the errors that were predicted stay with the solution that they are of.
    code, _, _ = run_rgbn("solve", SESSION, "--out", out, "-m", METHODS)
    assert code == 0
    assert json.loads((out / "summary.json").read_text())["trust"]["recommended"] == least
    # Another solution, not asked for them, makes them old: they are gone.
    code, _, _ = run_rgbn("solve", SESSION, "--out", out, "-m", "ls", "--no-trust")
    assert code == 0
    assert json.loads((out / "summary.json").read_text())["trust"] is None
    assert not (out / "trust").exists()
    assert not (out / "normals" / "best.npy").exists()
