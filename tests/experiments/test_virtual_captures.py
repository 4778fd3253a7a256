"""The virtual lab: its geometry, and what it writes."""

import numpy as np
import pytest

from benchmarks.virtual_lab import (
    BALLS,
    CAMERA,
    CENTRE_MM,
    Setup,
    lab_scene,
    object_maps,
)
from benchmarks.virtual_series import in_shadow, write_session
from scene.normals import angular_error_deg, unit
from scene.store import Store


def test_frames_are_left_out_in_which_the_white_ball_is_dark():
    """As a look at them tells; the ball's place is its own, not another corner's."""
    scene = lab_scene(Setup(frames=6))
    center = next(center for kind, _, center in BALLS if kind == "white")
    # By hand: a ball to the lower left.
    u = CAMERA.cx + CAMERA.fx * center[0] / -center[2]
    v = CAMERA.cy - CAMERA.fy * center[1] / -center[2]
    assert u < 80
    assert v > 160
    images = np.ones((6, CAMERA.height, CAMERA.width, 3), np.float32)
    rows, columns = np.indices((CAMERA.height, CAMERA.width))
    for frame, (x, y) in {1: (u, CAMERA.height - v), 2: (u, v), 4: (CAMERA.width - u, v)}.items():
        images[frame, np.hypot(columns - x, rows - y) < 30] = 0.02
    assert in_shadow(scene.lights.names, images) == [scene.lights.names[2]]


@pytest.mark.full
@pytest.mark.render
@pytest.mark.slow
def test_a_session_of_the_lab_is_registered(tmp_path, rgbn_process):
    """Nothing is given that a lab has not: lights are found as they were held, and the object where it stands."""
    setup = Setup("cardboard", 90.0, frames=12, seed=10002)
    write_session(tmp_path / "session", setup, "fold", setup.fold_deg)
    done = rgbn_process("align", tmp_path / "session", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "moved" not in done.stderr
    store, held = Store(tmp_path / "out"), lab_scene(setup).lights
    found = store.load_lights()
    kept = [held.names.index(name) for name in found.names]
    assert len(kept) >= 9
    # Seen from one place: the session's own reference point may lie elsewhere.
    directions, expected = (unit(one.toward(CENTRE_MM[None])[:, 0]) for one in (found, held))
    off_deg = angular_error_deg(directions, expected[kept])
    # Mirrors of 25 px: a tenth of a pixel on one is half a degree.
    assert np.median(off_deg) < 1.0
    assert (off_deg < 4 * np.sqrt(2) * found.direction_sigma_deg).all()
    for kind in ("chrome", "white"):
        told = sorted(tuple(ball.center_px) for ball in store.load_spheres() if ball.kind == kind)
        known = sorted(tuple(CAMERA.project(np.array(center)[None])[0]) for of, _, center in BALLS if of == kind)
        assert np.array(told) == pytest.approx(np.array(known), abs=0.8)
    pose, truth = store.read_json("pose.json"), object_maps(setup)[1]
    off_mm = np.linalg.norm(store.load_pose().translation - CENTRE_MM)
    assert off_mm < 3 * pose["sigma_mm"] < 60
    normals, mask = store.load_normals("truth"), store.load_mask()
    error_deg = angular_error_deg(normals[mask], truth[mask])
    assert np.nanmedian(error_deg) < 1.5
