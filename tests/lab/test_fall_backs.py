"""A session without balls and without a lights' file: what can run runs, and is judged by the given normals."""

import json

import cv2
import numpy as np
import pytest

DIRECTIONS = np.array([[0.5, 0, 0.8], [-0.5, 0.1, 0.8], [0, 0.6, 0.8], [0.1, -0.6, 0.8], [0.4, 0.4, 0.8], [0, 0, 1.0]])
DIRECTIONS = DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)


@pytest.fixture
def hills(tmp_path):
    """Six photographs of matte hills, their normals, and nothing that tells the lights."""
    v, u = np.mgrid[0:120, 0:160].astype(float)
    down, right = np.gradient(12 * np.sin(u / 12) * np.cos(v / 10) + 8 * np.sin((u + 2 * v) / 21))
    normals = np.stack([-right, down, np.ones_like(u)], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    rng = np.random.default_rng(10000)
    albedo = 0.3 + 0.2 * (np.sin(u / 17 + v / 29) > 0)
    for i, direction in enumerate(DIRECTIONS):
        image = albedo * np.maximum(normals @ direction, 0) * 1.5 + 1e-3 * rng.normal(size=u.shape)
        cv2.imwrite(str(tmp_path / f"f{i}.png"), np.clip(image * 65535, 0, 65535).astype(np.uint16))
    np.save(tmp_path / "normals.npy", normals.astype(np.float32))
    text = '[frames]\nflash = "f*.png"\nlinear = true\n'
    (tmp_path / "session.toml").write_text(text + '[object]\nnormals = "normals.npy"\n')
    return tmp_path


def test_given_normals_alone_leave_the_lights_unknown_and_it_is_said(hills, run_rgbn):
    out = hills.with_name(f"{hills.name}-out")
    code, printed, said = run_rgbn("calibrate", hills, "--out", out, "--json")
    assert code == 0, said
    assert "no probe tells the lights" in " ".join(row["text"] for row in json.loads(printed)["warnings"])
    code, _, said = run_rgbn("solve", hills, "--out", out, "--method", "ls")
    assert code == 2
    assert "--method ldr,entropy,tv" in said
