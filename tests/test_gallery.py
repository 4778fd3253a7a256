"""The sessions of the gallery are what their text says."""

import numpy as np

from calibrate.known_lights.read_known import read_lights
from capture.session.session import load_session
from docs.write_gallery import DOCS, EXAMPLES

MADE = {example.name: example.make for example in EXAMPLES}
COUNT = 12


def test_the_wrong_lights_are_each_the_next_one_s(tmp_path):
    angles = 0.3 * np.arange(COUNT)
    right = np.stack([0.6 * np.cos(angles), 0.6 * np.sin(angles), np.full(COUNT, 0.8)], 1)
    rows = [f"flash_{k:03d}.dng {x:.8f} {y:.8f} {z:.8f}" for k, (x, y, z) in enumerate(right)]
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / "lights.lp").write_text("\n".join([str(COUNT), *rows]) + "\n")
    session = load_session(MADE["lights"](tmp_path / "place", tmp_path))
    assert (session.scan, session.spheres) == (None, ())
    lights = read_lights(session.lights_file, tuple(path.stem for path in session.flash))
    np.testing.assert_allclose(lights.directions, np.roll(right, -1, 0), atol=1e-6)
    normals = np.load(session.normals)
    known = np.isfinite(normals).all(-1)
    assert known.sum() > 20_000
    np.testing.assert_allclose(np.linalg.norm(normals[known], axis=-1), 1, atol=1e-4)


def test_the_one_without_a_scan_has_all_else(tmp_path):
    session = load_session(MADE["photographs"](tmp_path, tmp_path))
    assert session.scan is None
    assert [ball.kind for ball in session.spheres] == ["chrome", "chrome", "white"]
    assert len(session.flash) == COUNT


def test_every_example_is_on_the_page():
    page = (DOCS / "gallery.md").read_text()
    assert [f"## {example.title}" for example in EXAMPLES] == [
        line for line in page.splitlines() if line.startswith("## ")
    ]
