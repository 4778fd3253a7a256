"""fixtures/bumpy: its truth is that of its files."""

import json
import tomllib
from pathlib import Path

import numpy as np
import rawpy
import trimesh

from scene.camera import Camera
from scene.lights import Lights
from scene.mesh import Mesh
from scene.pose import Pose
from scene.spheres import Sphere
from twin.visibility import Sight

FOLDER = Path(__file__).parents[2] / "fixtures" / "bumpy"
TRUTH = json.loads((FOLDER / "truth.json").read_text())
ARRAYS = np.load(FOLDER / "truth.npz")
SESSION = tomllib.loads((FOLDER / "session.toml").read_text())
CAMERA = Camera(**SESSION["camera"])


def green(name):
    """Return the green pixels of the odd rows' filter, linear, where they lie: (H / 2, W / 2)."""
    with rawpy.imread(str(FOLDER / "raw" / f"{name}.dng")) as raw:
        assert raw.color_desc == b"RGBG"
        assert raw.raw_pattern[0, 1] == 1
        return (raw.raw_image[::2, 1::2].astype(float) - raw.black_level_per_channel[1]) / (raw.white_level - 512)


def test_it_is_small_and_whole():
    files = [path for path in FOLDER.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 20e6
    names = sorted(path.name for path in (FOLDER / "raw").iterdir())
    assert names == ["ambient_000.dng", *(f"flash_{i:03d}.dng" for i in range(12))]
    assert [ball["kind"] for ball in SESSION["spheres"]] == [ball["kind"] for ball in TRUTH["spheres"]]
    # The truth is for judging: the session says nothing of it.
    assert "truth" not in (FOLDER / "session.toml").read_text()


def test_directions_and_intensities_are_those_of_the_positions_and_powers():
    toward = ARRAYS["light_positions_mm"] - TRUTH["object_centre_mm"]
    distance = np.linalg.norm(toward, axis=1, keepdims=True)
    assert np.allclose(TRUTH["directions_at_object"], toward / distance)
    intensity = ARRAYS["light_power"] / distance**2
    assert np.allclose(TRUTH["relative_intensity_rgb_at_object"], intensity / intensity.mean(0))
    elevation = np.degrees(np.arcsin(np.array(TRUTH["directions_at_object"])[:, 2]))
    assert 25 < elevation.min() < elevation.max() < 75


def test_the_white_ball_is_as_bright_as_the_truth_says():
    """One factor fits all frames: Lambert's cosine and the square of the distance, to 2 %."""
    ball = next(ball for ball in TRUTH["spheres"] if ball["kind"] == "white")
    sphere = Sphere("white", np.array(ball["centre_px"]), ball["radius_px"], ball["diameter_mm"])
    pixels = CAMERA.grid()[::2, 1::2]
    normals, points = sphere.normals(CAMERA, pixels)
    assert np.allclose(sphere.center_mm(CAMERA), ball["centre_mm"])
    ambient = green("ambient_000")
    factors = []
    for index in range(12):
        toward = ARRAYS["light_positions_mm"][index] - points
        distance = np.linalg.norm(toward, axis=-1)
        cosine = np.sum(normals * toward, -1) / distance
        lit = (cosine > 0.5) & (-normals[..., 2] < -0.5)
        expected = ARRAYS["light_power"][index, 1] * cosine / distance**2
        factors.append(np.median(((green(f"flash_{index:03d}") - ambient) / expected)[lit]))
    assert np.ptp(factors) / np.mean(factors) < 0.02


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
