"""`import rgbn`: the same steps as the command line's, their results as the house's types."""

import numpy as np
import pytest

import rgbn
from fixtures.bad_input import samples
from scene.errors import SceneError


def test_a_session_opened_in_python(tmp_path):
    """Each verb runs what it needs and no more, once; what it returns is what the folder holds."""
    samples.write_pictures(tmp_path / "session")
    (tmp_path / "session" / "session.toml").write_bytes(samples.toml_bytes(samples.SMALL))
    run = rgbn.open(tmp_path / "session", out=tmp_path / "out")
    assert not (tmp_path / "out").exists(), "nothing runs yet"
    found = run.solve("ls")
    assert found.summary["seconds"].keys() == {"check", "calibrate", "align", "solve"}
    normals = found.normals("ls")
    assert normals.shape == (*found.mask.shape, 3) == found.truth.shape == found.albedo("ls").shape
    assert len(found.lights) == len(found.frames)
    assert found.camera.width == normals.shape[1]
    assert np.allclose(np.linalg.norm(normals[found.mask & np.isfinite(normals[..., 0])], axis=-1), 1, atol=1e-5)
    before = (tmp_path / "out" / "normals" / "ls.npy").stat().st_mtime_ns
    assert run.solve("ls").summary["seconds"] == found.summary["seconds"], "done and current is not done again"
    assert (tmp_path / "out" / "normals" / "ls.npy").stat().st_mtime_ns == before
    with pytest.raises(SceneError, match="unknown"):
        run.solve("best")


def test_a_folder_that_is_no_session_is_refused_when_it_is_opened(tmp_path):
    with pytest.raises(SceneError, match="session"):
        rgbn.open(tmp_path)
