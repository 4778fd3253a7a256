"""fixtures/bumpy: its truth is that of its files."""

import json
import tomllib
from pathlib import Path

import numpy as np
import trimesh

from scene.camera import Camera
from scene.lights import Lights
from scene.mesh import Mesh
from scene.pose import Pose
from twin.visibility import Sight

FOLDER = Path(__file__).parents[2] / "fixtures" / "bumpy"
TRUTH = json.loads((FOLDER / "truth.json").read_text())
ARRAYS = np.load(FOLDER / "truth.npz")
SESSION = tomllib.loads((FOLDER / "session.toml").read_text())
CAMERA = Camera(**SESSION["camera"])


def test_it_is_small_and_whole():
    files = [path for path in FOLDER.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 20e6
    names = sorted(path.name for path in (FOLDER / "raw").iterdir())
    assert names == ["ambient_000.dng", *(f"flash_{i:03d}.dng" for i in range(12))]
    assert [ball["kind"] for ball in SESSION["spheres"]] == [ball["kind"] for ball in TRUTH["spheres"]]
    # The truth is for judging: the session says nothing of it.
    assert "truth" not in (FOLDER / "session.toml").read_text()


def test_the_scan_at_the_true_pose_is_the_object_that_was_photographed():
    shape = trimesh.load(FOLDER / "scan" / "object.ply", process=False)
    assert shape.is_watertight
    assert 20_000 <= len(shape.faces) <= 40_000
    mesh = Mesh(Pose(np.array(TRUTH["camera_from_scan"])).apply(shape.vertices), np.array(shape.faces))
    mask, lights = np.zeros((480, 640), bool), Lights(("any",), np.array([[0, 0, 1.0]]), np.ones((1, 3)))
    sum_of_cosines = []
    for band, face, weights, _ in Sight(mesh, CAMERA, lights).rows(slice(0, 480), slice(0, 640)):
        mask[band] = face >= 0
        both = mask[band] & ARRAYS["mask"][band]
        found = np.einsum("pc,pcx->px", weights[both], mesh.vertex_normals[mesh.faces[face[both]]])
        found /= np.linalg.norm(found, axis=1, keepdims=True)
        sum_of_cosines.append(np.sum(found * ARRAYS["normals"][band][both], 1))
    assert np.count_nonzero(mask ^ ARRAYS["mask"]) < 60  # pixels on the outline
    assert np.degrees(np.arccos(np.median(np.concatenate(sum_of_cosines)))) < 0.8
