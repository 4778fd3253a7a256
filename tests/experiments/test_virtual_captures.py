"""The virtual lab: its geometry, what it writes, and that a pair is made again when it must be."""

import numpy as np
import pytest

from benchmarks import virtual_pairs as pairs
from benchmarks.virtual_lab import (
    BALLS,
    CAMERA,
    CENTRE_MM,
    VIRTUAL_EXPERIMENTS,
    Experiment,
    Setup,
    lab_scene,
    object_maps,
    object_scene,
)
from benchmarks.virtual_pairs import in_shadow
from experiments.compare_folders import NUMBERS
from scene.errors import SceneError
from scene.files import write_json
from scene.normals import angular_error_deg, unit
from scene.output_folder import open_record
from scene.spheres import Sphere
from scene.store import Store


def test_the_hand_misses_the_recipe_by_what_a_hand_misses():
    setup = Setup(ring_deg=55.0, frames=400, seed=10001)
    exact, held = object_scene(setup).lights, lab_scene(setup).lights
    polar = np.degrees(np.arccos(exact.directions[:, 2]))
    assert polar == pytest.approx(np.full(400, 55.0))
    off_deg = angular_error_deg(exact.directions, held.directions)
    # Two tangent components of three degrees.
    assert np.sqrt(np.mean(off_deg**2)) == pytest.approx(3 * np.sqrt(2), rel=0.1)
    assert held.positions_mm is not None
    distance = np.linalg.norm(held.positions_mm - CENTRE_MM, axis=1)
    # One energy a flash: what is nearer shines brighter.
    power = held.intensities[:, 0] * distance**2
    assert np.std(power / power.mean()) == pytest.approx(0.03, rel=0.15)
    assert np.corrcoef(held.intensities[:, 0], distance**-2)[0, 1] > 0.9


@pytest.mark.parametrize("fold_deg", [60.0, 120.0])
def test_the_cardboard_opens_toward_the_viewer_by_its_angle(fold_deg):
    mask, truth = object_maps(Setup("cardboard", fold_deg))
    columns = np.flatnonzero(mask.any(0))
    row = np.flatnonzero(mask.any(1)).mean().astype(int)
    left, right = truth[row, columns[3]], truth[row, columns[-4]]
    assert left[0] > 0 > right[0]
    assert angular_error_deg(left, right) == pytest.approx(180 - fold_deg, abs=0.1)
    assert min(left[2], right[2]) > 0


def test_a_pair_is_made_again_when_its_setup_or_the_code_has_changed(tmp_path, monkeypatch):
    made, stopped = [], []

    def compare(real, twin, out, *, methods):
        if stopped:
            raise KeyboardInterrupt
        made.append(out.name)
        write_json(out / NUMBERS, {"made": len(made)})

    monkeypatch.setattr(pairs, "reference_balls", lambda out: [])
    monkeypatch.setattr(pairs, "process_capture", lambda folder, done, setup, balls: done)
    monkeypatch.setattr(pairs, "write_rendering", lambda store, setup, name: None)
    monkeypatch.setattr(pairs, "compare_folders", compare)

    def run(**fixed):
        made.clear()
        one = Experiment("iso", "", "iso", (100.0, 400.0), "", Setup(**fixed))
        ((_, found),) = pairs.run_experiments(tmp_path, (one,), tell=lambda text: None)
        assert [pair.level for pair in found] == [100.0, 400.0]
        return list(made)

    both = ["iso-100", "iso-400"]
    assert run() == both
    assert run() == []
    assert run(seed=10001) == both
    with monkeypatch.context() as patch:
        patch.setattr(pairs, "METHODS", ("ls",))
        assert run(seed=10001) == both
    with monkeypatch.context() as patch:
        patch.setattr(pairs, "code_fingerprint", lambda: "other code")
        stopped.append(True)
        with pytest.raises(KeyboardInterrupt):
            run(seed=10001)
        stopped.clear()
        assert run(seed=10001) == both
        assert run(seed=10001) == []


def test_balls_are_told_apart_by_kind_and_side(tmp_path):
    def ball(kind, u):
        return Sphere(kind, np.array([u, 100.0]), 25.0)

    left, right, white = ball("chrome", 5.0), ball("chrome", 90.0), ball("white", 300.0)
    ordered = pairs.in_order([white, right, left], tmp_path)
    assert [(one.kind, one.center_px[0]) for one in ordered] == [("chrome", 5.0), ("chrome", 90.0), ("white", 300.0)]
    for wrong in ([left, right], [left, right, left], [left, white, white]):
        with pytest.raises(SceneError, match=r"found \d (chrome|white) balls, expected \d; no other session"):
            pairs.in_order(wrong, tmp_path)


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
def test_a_pair_is_photographed_processed_and_compared(tmp_path):
    """One easy level, all the way: the lights are found as they were held, and the two sides err alike."""
    one = Experiment("iso", "", "iso", (100.0,), "", Setup(frames=12, seed=10001))
    ((_, (pair,)),) = pairs.run_experiments(tmp_path, (one,), tell=lambda text: None)
    capture, rendering = tmp_path / "processed-iso-100", tmp_path / "rendered-iso-100"
    setup = next(setup for _, setup in one.setups())
    held, found = lab_scene(setup).lights, Store(capture).load_lights()
    kept = [held.names.index(name) for name in found.names]
    assert len(kept) >= 9
    # Seen from one place: the session's own reference point lies amid the balls.
    directions, expected = (unit(one.toward(CENTRE_MM[None])[:, 0]) for one in (found, held))
    off_deg = angular_error_deg(directions, expected[kept])
    # Mirrors of 25 px: a third of a pixel on one is a degree and a half.
    assert np.median(off_deg) < 2.0
    assert (off_deg < 4 * np.sqrt(2) * found.direction_sigma_deg).all()
    with open_record(tmp_path) as record:
        reference = pairs.reference_balls(record)
    for ball, (kind, radius, center) in zip(reference, BALLS, strict=True):
        u = CAMERA.cx + CAMERA.fx * center[0] / -center[2]
        v = CAMERA.cy - CAMERA.fy * center[1] / -center[2]
        assert ball.kind == kind
        # A mirror of 25 px beside a white card.
        assert ball.center_px == pytest.approx([u, v], abs=0.8)
        assert ball.radius_px == pytest.approx(CAMERA.fx * radius / -center[2], abs=0.8)
    mask, truth = object_maps(setup)
    assert np.array_equal(Store(capture).load_mask(), mask)
    assert np.nanmax(angular_error_deg(Store(capture).load_normals("truth")[mask], truth[mask])) < 0.1
    exact = Store(rendering).load_lights()
    assert np.max(angular_error_deg(exact.directions, object_scene(setup).lights.directions)) < 0.01
    assert {kind: one["kind"] for kind, one in pair.found["captures"].items()} == {
        "real": "virtual capture",
        "twin": "rendering",
    }
    assert pair.medians("real")["ls"] < 3.0
    assert pair.medians("twin")["ls"] < 2.0
    assert pair.found["left_out"] == []
    assert pair.found["reasons"]["level"] != "differ"


def test_every_experiment_goes_from_easy_to_hard_in_four_steps_or_more():
    assert [one.name for one in VIRTUAL_EXPERIMENTS] == ["ambient", "cardboard", "iso", "ring"]
    for one in VIRTUAL_EXPERIMENTS:
        setups = [setup for _, setup in one.setups()]
        assert 4 <= len(set(setups)) <= 6
