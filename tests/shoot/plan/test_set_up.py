"""A set-up: which way an object is turned, which samples are seen, how noisy they are to the virtual camera."""

import numpy as np
import pytest

from fixtures.ball_scene import develop
from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import decode
from scene.mesh import Mesh
from shoot.plan.plan_options import AS_USUAL, PlanOptions
from shoot.plan.set_up import (
    ObjectPixels,
    before_camera,
    lens_camera,
    lights_at,
    out_of_view,
    pixels_of,
    places_in_reach,
)
from solve.samples import GRAY
from twin.camera.virtual_camera import Sensor
from twin.description.object_mesh import built_in

CAMERA = lens_camera(50.0, 36.0, (600, 400))


def ball():
    sphere = built_in("sphere")
    return before_camera(Mesh(50.0 * sphere.vertices, sphere.faces), CAMERA)


@pytest.mark.parametrize(
    ("seen_from", "right", "up"),
    [("+z", "x", "y"), ("-z", "-x", "y"), ("+x", "y", "z"), ("-x", "-y", "z"), ("+y", "-x", "z"), ("-y", "x", "z")],
)
def test_the_scan_is_turned_and_not_mirrored(seen_from, right, up):
    axes = {name: sign * row for sign, names in ((1, "xyz"), (-1, ("-x", "-y", "-z")))
            for name, row in zip(names, np.eye(3), strict=True)}  # fmt: skip
    toward = axes[seen_from.lstrip("+")]
    box = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    marks = np.stack([axes[right], axes[up], toward])
    placed = before_camera(Mesh(np.concatenate([box, marks]), np.zeros((0, 3), int)), CAMERA, seen_from)
    found = placed.vertices[-3:] - placed.center_mm
    assert found == pytest.approx(np.eye(3), abs=1e-12)


def test_a_convex_body_shadows_itself_alone_and_a_wall_its_foot():
    pixels = pixels_of(CAMERA, ball(), 300)
    middle = pixels.middle_mm
    shown = pixels.under(lights_at(places_in_reach(AS_USUAL, middle, 100.0), middle))
    shade = np.einsum("fpi,pi->fp", shown.vectors, pixels.normals)
    # At the terminator the facets, not the smooth normals, decide.
    clear = np.abs(shade) > 0.08
    assert (shown.seen == (shade > 0))[clear].mean() > 0.999
    floor = np.array([[-50, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]], float)
    wall = np.array([[0, -50, 0], [0, 50, 0], [0, 50, 60], [0, -50, 60]], float)
    quad = np.array([[0, 1, 2], [0, 2, 3]])
    mesh = Mesh(np.concatenate([floor, wall]) - [0, 0, 600], np.concatenate([quad, quad + 4, quad[:, ::-1] + 4]))
    up = np.array([[0, 0, 1.0], [0, 0, 1.0]])
    points = np.array([[-20, 0, -600], [20, 0, -600.0]])
    two = ObjectPixels(CAMERA, mesh, points, up, up, np.full(2, 0.5))
    shown = two.under(lights_at(np.array([[800, 0, 0], [-800, 0, 0.0]]), np.array([0, 0, -600.0])))
    assert shown.seen.tolist() == [[False, True], [True, False]]


@pytest.mark.parametrize("iso", [100.0, 3200.0])
def test_the_noise_is_that_of_the_virtual_camera(iso):
    """Gray of a plain picture through a Bayer sensor and the decoder, against what a plan says of it."""
    sensor = Sensor(iso=iso)
    plate = np.array([[-50, -50, -900], [50, -50, -900], [50, 50, -900], [-50, 50, -900]], float)
    mesh = Mesh(plate, np.array([[0, 1, 2], [0, 2, 3]]))
    up = np.array([[0, 0, 1.0]])
    pixel = ObjectPixels(CAMERA, mesh, np.array([[0, 0, -900.0]]), up, up, np.array([0.4]), sensor, 0.8)
    lights = lights_at(np.array([[300, 0, -100], [-300, 0, -100.0], [0, 300, -100]]), np.array([0, 0, -900.0]))
    shown = pixel.under(lights)
    value = 0.8 * 0.4 * (lights.directions[0] @ [0, 0, 1])
    codes = develop(np.full((300, 400, 3), value), sensor, np.random.default_rng(0))
    gray = decode(codes) @ GRAY
    assert gray.std() / gray.mean() == pytest.approx(shown.noise[0, 0] / (0.4 * shown.vectors[0, 0, 2]), rel=0.04)


def test_flashes_stay_in_reach_and_out_of_the_picture():
    middle = np.array([0, 0, -800.0])
    ring, sector = PlanOptions(from_deg=50.0, to_deg=50.0), PlanOptions(azimuths_deg=(300.0, 60.0))
    thin = (PlanOptions(from_deg=12.0, to_deg=12 + 1e-9), PlanOptions(from_deg=0.0, to_deg=1e-9))
    for options in (AS_USUAL, ring, sector, *thin):
        away = places_in_reach(options, middle, 100.0) - middle
        zenith = np.degrees(np.arccos(away[:, 2] / np.linalg.norm(away, axis=1)))
        assert np.linalg.norm(away, axis=1) == pytest.approx(700.0)
        assert zenith.max() <= options.to_deg + 1e-9
        assert zenith.min() >= options.from_deg - 1e-9
        azimuth = np.degrees(np.arctan2(away[:, 1], away[:, 0]))
        assert options is not sector or np.abs(azimuth).max() <= 60
    assert len(out_of_view(CAMERA, np.array([[0, 0, -300.0], [0, 0, 50], [600, 0, -300]]))) == 2
    with pytest.raises(SceneError, match="all 1 places in reach stand in the picture"):
        out_of_view(CAMERA, np.array([[0, 0, -300.0]]))
    assert len(out_of_view(Camera.orthographic(64, 48), middle[None])) == 1, "it is not known where its sides are"
    with pytest.raises(SceneError, match="--azimuths-deg 0 10"):
        places_in_reach(PlanOptions(azimuths_deg=(0.0, 10.0)), middle, 100.0)
    with pytest.raises(SceneError, match="--from-deg 50"):
        places_in_reach(PlanOptions(from_deg=50.0, to_deg=40.0), middle, 100.0)
