"""The pictures of a registration: to a fraction of a pixel in place, and in the photograph's own tones."""

import cv2
import numpy as np
import pytest

from compare.report import registration_pictures
from compare.report.pictures import Exposure, PixelBox
from fixtures.lit_surfaces import ball_seen, matte
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.store import Store

ALBEDO = np.array([0.6, 0.5, 0.3])


def scene(width, height):
    """Four frames of a disc lit from four sides on grey, its mask, and its outline in strokes."""
    directions = np.array([[-0.6, 0, 0.8], [0, 0.6, 0.8], [0.6, 0, 0.8], [0, -0.6, 0.8]])
    intensities = np.array([[1.1, 1.0, 0.9], [0.9, 1.0, 1.1], [1.0, 1.2, 1.0], [1.0, 0.8, 1.0]])
    lights = Lights(("left", "top", "right", "bottom"), directions, intensities)
    center, radius = np.array([0.47 * width, 0.52 * height]), 0.3 * height
    u, v = center - (np.array([width, height]) - 1) / 2
    points, normals, mask = ball_seen(Camera.orthographic(width, height), (u, -v, -radius), radius, rim=0)
    images = np.where(mask[..., None], matte(lights, points, normals, ALBEDO), 0.1)
    angle = np.linspace(0, 2 * np.pi, 1500, endpoint=False)
    outline = center + radius * np.stack([np.cos(angle), np.sin(angle)], -1)
    strokes = np.stack([outline, np.roll(outline, -1, 0)], 1)
    return Frames.from_linear(lights.names, images), lights, mask, strokes


def test_strokes_lie_where_their_pixels_are_to_a_tenth_of_a_pixel():
    image = np.zeros((90, 90, 3), np.uint8)
    stroke = np.array([[[20.0, 27.3], [34.9, 27.3]]])
    drawn = registration_pictures.draw_strokes(image, stroke, [20, 25], 6.0)[..., 0].astype(float)
    row = (drawn * np.arange(90)[:, None]).sum() / drawn.sum()
    # Pixel 25's centre is row 2.5 of its six.
    assert row == pytest.approx((27.3 - 25 + 0.5) * 6 - 0.5, abs=0.3)
    assert drawn[:, :2].sum() == 0
    assert drawn[:, 40].sum() > 0


def test_the_zooms_show_each_side_in_the_frame_that_lights_it_and_the_line_on_its_edge():
    frames, lights, _, strokes = scene(600, 400)
    image = registration_pictures.zoom_picture(frames, Exposure.for_frames(frames), lights.directions, strokes)
    side = 46 * registration_pictures.ZOOM
    assert image.shape == (26 + side + 4 + side, 4 * side + 18, 3)
    left = image[26 : 26 + side, :side].astype(int)
    drawn = image[30 + side :, :side].astype(int)
    line = (np.abs(drawn - left).sum(-1) > 100)[side // 2]
    step = np.abs(np.diff(left[side // 2].sum(-1)))
    # A shadowed limb would have no step; the line runs within a pixel of it.
    assert step.max() > 150
    assert abs(np.flatnonzero(line).mean() - np.argmax(step)) < registration_pictures.ZOOM


def test_all_pictures_are_written_and_read_back(tmp_path):
    frames, lights, mask, strokes = scene(300, 200)
    store = Store(tmp_path)
    registration_pictures.write_pictures(store, frames, lights, strokes=strokes, mask=mask)
    shapes = {path.stem: cv2.imread(str(path)).shape for path in (tmp_path / "align").glob("*.png")}
    assert set(shapes) == {"outline", "outline_zoom"}
    read = registration_pictures.read_picture(store, "outline")
    assert read is not None
    # Red, green, blue, as it was drawn.
    assert (np.abs(read.astype(int) - registration_pictures.SCAN_COLOUR).max(-1) < 40).sum() > 500
    assert registration_pictures.read_picture(store, "none") is None
    # The mask's outline lies on its edge.
    registration_pictures.write_pictures(store, frames, lights, strokes=strokes[:1], mask=mask)
    read = registration_pictures.read_picture(store, "outline").astype(int)
    box = PixelBox.of_mask(mask, margin=0.12)
    v, u = np.nonzero(np.abs(read - registration_pictures.MASK_COLOUR).max(-1) < 60)
    places = (np.stack([u, v], -1) + 0.5) * box.width / read.shape[1] - 0.5 + [box.left, box.top]
    away = np.linalg.norm(places - strokes.reshape(-1, 2).mean(0), axis=1) - 0.3 * 200
    assert len(places) > 500
    assert np.abs(away).max() < 1.5
