"""Two materials on one object: told apart where they are, and not where there is one; and the twin of both."""

from dataclasses import replace

import numpy as np
import pytest

from compare.report.twin_section import material_words
from scene.camera import Camera
from scene.frames import Frames
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose
from tests.twin.test_fit_material import SIDE, WHITE, dome, made
from twin.description.description import Sampling, TwinObject, TwinScene
from twin.description.materials import RoughPlastic
from twin.description.object_mesh import ObjectMesh, built_in
from twin.engines.many import Many
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.variant import SLOW, import_mitsuba, pick_variant
from twin.material.fit_material import fit_material
from twin.material.material_light import material_scene
from twin.material.material_places import Places, material_places
from twin.material.material_regions import TURN, Neighbours
from twin.material.material_samples import Samples, inner_pixels
from twin.material.measured_albedo import filled
from twin.material.reflection_models import coat, reflected
from twin.material.scan_material import albedo_of, scan_material
from twin.visibility import Sight

LIGHTS = dome(16)


def of_two(
    materials: tuple[tuple[float, float], tuple[float, float]], where: np.ndarray, albedo: np.ndarray, noise: float
) -> tuple[Samples, np.ndarray, np.ndarray]:
    """Return a ball's samples of two roughnesses and specularities, which is where (P,), and its brightest highlight.

    `where`, `albedo`: (H, W).
    """
    samples = made(None, 0.0, LIGHTS)
    place = where[samples.rows, samples.columns].astype(int)
    matter = albedo[samples.rows, samples.columns, None, None] * WHITE
    values, shine = np.zeros(samples.values.shape), np.zeros(len(samples))
    for number, (roughness, specularity) in enumerate(materials):
        body, gloss = reflected(coat(roughness), samples.normals, samples.views, samples.toward)
        light = samples.irradiance * (matter * body[..., None] + specularity * WHITE * gloss[..., None])
        values = np.where((place == number)[:, None, None], light, values)
        shine = np.maximum(shine, np.where(samples.usable, specularity * gloss, 0).max(1))
    values += noise * np.random.default_rng(10_050).standard_normal(values.shape)
    return replace(samples, values=values.astype(np.float32)), place, shine


ROWS, COLUMNS = np.mgrid[:SIDE, :SIDE]
HALVES = COLUMNS > SIDE // 2
PATCH = np.hypot(COLUMNS - 38, ROWS - 28) < 12
CHECKED = 0.15 + 0.6 * ((COLUMNS // 8 + ROWS // 8) % 2)
ACROSS = 0.15 + 0.6 * (ROWS > SIDE // 2)


@pytest.mark.full
@pytest.mark.parametrize(
    ("materials", "where", "albedo", "noise"),
    [(((0.2, 0.3), (0.35, 0.7)), HALVES, ACROSS, 3e-3), (((0.3, 0.3), (0.3, 0.6)), PATCH, CHECKED, 1e-3)],
)
def test_two_glosses_are_told_apart_whatever_the_albedo(materials, where, albedo, noise) -> None:
    samples, place, shine = of_two(materials, where, albedo, noise)
    found = material_places(samples, LIGHTS, fit_material(samples, LIGHTS))
    assert len(found.fits) == 2
    assert "BIC falls" in str(found)
    assert found.shares[0] >= found.shares[1]
    order = (0, 1) if np.mean(place) < 0.5 else (1, 0)
    right = np.asarray(order)[found.labels] == place
    assert np.mean(right[shine > 0.02]) > 0.95
    for fit, number in zip(found.fits, order, strict=True):
        assert abs(fit.surface.roughness / materials[number][0] - 1) < 0.05
        assert abs(fit.specularity / materials[number][1] - 1) < 0.05


@pytest.mark.full
@pytest.mark.parametrize("disturbed", ["noise", "normals", "lobes"])
def test_one_material_stays_one(disturbed: str) -> None:
    generator = np.random.default_rng(10_051)
    samples = of_two(((0.25, 0.5), (0.25, 0.5)), HALVES, ACROSS, 3e-3)[0]
    if disturbed == "normals":
        from scipy.ndimage import gaussian_filter

        lean = np.stack([gaussian_filter(generator.standard_normal((SIDE, SIDE)), 6) for _ in range(3)], -1)
        off = 0.03 * lean[samples.rows, samples.columns] / lean.std()
        samples = replace(samples, normals=unit(samples.normals + off).astype(np.float32))
    if disturbed == "lobes":
        gloss = reflected(coat(0.6), samples.normals, samples.views, samples.toward)[1]
        more = samples.irradiance * 0.8 * WHITE * gloss[..., None]
        samples = replace(samples, values=(samples.values + more).astype(np.float32))
    found = material_places(samples, LIGHTS, fit_material(samples, LIGHTS))
    assert len(found.fits) == 1
    assert not found.labels.any()
    assert "with two places" in str(found) or "no two places" in str(found)


@pytest.mark.full
def test_a_matte_object_is_not_divided() -> None:
    samples = made(None, 0.0, LIGHTS)
    assert len(material_places(samples, LIGHTS, fit_material(samples, LIGHTS)).fits) == 1


def test_the_cut_is_the_least_of_all_labellings() -> None:
    generator = np.random.default_rng(10_052)
    rows, columns = (a.ravel() for a in np.mgrid[:3, :3])
    near = Neighbours(rows, columns)
    labellings = np.array(np.unravel_index(np.arange(1 << 9), (2,) * 9)).T
    border = TURN * np.array([near.parted(one) for one in labellings])
    description = np.array([near.description(one) for one in labellings])
    fewer = 0
    for _ in range(20):
        own = 4 * TURN * generator.standard_normal(9)
        raw, found = near.least(own), near.cut(own)
        # Costs are rounded to thousandths.
        assert TURN * near.parted(raw) + own @ raw <= np.min(border + labellings @ own) + 0.02
        told = near.description(found) + own @ found
        assert np.min(description + labellings @ own) - 1e-9 <= told <= near.description(raw) + own @ raw + 1e-9
        fewer += near.islands(found)[0] < near.islands(raw)[0]
    assert fewer > 0


@pytest.mark.full
def test_every_pixel_of_the_mask_is_of_the_nearest_sample() -> None:
    samples = made(None, 0.0, LIGHTS)
    fit = fit_material(samples, LIGHTS)
    labels = (samples.columns > 31).astype(np.intp)
    some = np.arange(len(samples)) % 5 == 0
    mask = np.zeros((SIDE, SIDE), bool)
    mask[samples.rows, samples.columns] = True
    picture = Places((fit, fit), labels[some], "").picture(samples.only(some), mask)
    assert (picture[~mask] == -1).all()
    assert np.mean(picture[mask] == (COLUMNS > 31)[mask]) > 0.97


@pytest.mark.render
@pytest.mark.skipif(pick_variant()[0] == SLOW, reason="no LLVM that works is here")
@pytest.mark.full
def test_the_twin_of_two_materials_looks_like_the_object() -> None:
    import_mitsuba()
    lights = dome(12)
    camera = Camera(120, 100, 260.0, 260.0, 59.3, 50.8)
    matrix = np.diag([25.0, 25.0, 25.0, 1.0])
    matrix[2, 3] = -200
    ball = built_in("sphere")
    left = ball.vertices[ball.faces].mean(1)[:, 0] < 0.2
    halves = [ObjectMesh(ball.vertices, ball.faces[own], ball.normals, ball.texcoords) for own in (left, ~left)]
    true = (RoughPlastic((0.5, 0.3, 0.2), 0.2, 0.3), RoughPlastic((0.5, 0.3, 0.2), 0.4, 0.9))
    objects = tuple(TwinObject(name, half, name, matrix) for name, half in zip("ab", halves, strict=True))
    scene = TwinScene(camera, objects, dict(zip("ab", true, strict=True)), lights)

    def rendered(one: TwinScene) -> np.ndarray:
        film, images = one.film(), np.zeros((12, 100, 120, 3), np.float32)
        images[:, film.rows, film.columns] = Many(mitsuba_scene(one), film, lights, max_depth=2).band(
            slice(0, film.size[0]), 64
        )[0]
        return images

    truth = rendered(scene)
    mask, mesh, pose = truth.max((0, -1)) > 0, TwinObject("", ball, "", matrix).placed, Pose(np.eye(4))
    scan = Mesh(mesh.vertices, mesh.faces)
    sight = Sight.of_scan(scan, pose, camera, lights)
    found = scan_material(sight, Frames.from_linear(lights.names, truth), mask)
    facts = found.facts()
    assert facts["model"] == "two materials"
    page = material_words({"material": {**facts, "relative_rmse_per_frame": facts["relative_rmse_per_frame"].tolist()}})
    for number, one in enumerate(facts["places"], 1):
        assert f"Place {number}, " in page
        assert f'data-value="{one["share"]!r}"' in page
        assert one["sentence"] in page
    # Where the surface lies a ball's radius before its middle: nearly the border, as the camera sees it.
    there = (camera.rays(camera.grid())[1] * 178)[..., 0] < 0.2 * 25
    assert np.mean((found.labels == 0)[mask] == there[mask]) > 0.95
    for fit, material in zip(found.places.fits, true, strict=True):
        assert abs(fit.surface.roughness / material.roughness - 1) < 0.05
        assert abs(fit.specularity / float(material.specularity) - 1) < 0.05  # type: ignore[arg-type]

    inner = np.zeros_like(mask)
    inner[inner_pixels(mask, None)] = True

    def off(fits, labels, albedo) -> float:
        twin, warnings = material_scene(sight, fits, labels, albedo, Sampling("many", max_depth=2))
        assert not warnings
        assert sum(len(one.mesh.faces) for one in twin.objects) >= len(scan.faces)
        assert len(twin.objects) == len(fits)
        return float(np.linalg.norm((rendered(twin) - truth)[:, inner]) / np.linalg.norm(truth[:, inner]))

    both, one = off(found.places.fits, found.labels, found.albedo), off((found.fit,), None, found.albedo)
    swapped = off(found.places.fits[::-1], found.labels, found.albedo)
    assert both < 0.01
    assert one > 5 * both
    assert swapped > 5 * both


def test_unknown_pixels_get_what_the_nearest_known_one_has():
    rng = np.random.default_rng(10_071)
    image, known = rng.random((23, 31, 3)).astype(np.float32), rng.random((23, 31)) < 0.1
    at, every = np.argwhere(known), np.argwhere(np.ones(known.shape, bool))
    square = ((every[:, None] - at) ** 2).sum(-1)
    out = filled(image, known)
    for (row, column), apart in zip(every, square, strict=True):
        # Of several that are equally near, any.
        nearest = at[apart == apart.min()]
        assert any(np.array_equal(out[row, column], image[r, c]) for r, c in nearest)
    assert filled(image, np.ones(known.shape, bool)) is image


@pytest.mark.full
def test_albedo_in_pieces_is_the_albedo_at_once():
    samples = made(0.2, 0.3, LIGHTS)
    fit = fit_material(samples, LIGHTS)
    which = np.arange(len(samples)) % 3
    together, pieces = albedo_of(samples, fit), np.empty((len(samples), 3), np.float32)
    for number in range(3):
        pieces[which == number] = albedo_of(samples.only(which == number), fit)
    assert np.array_equal(together, pieces)
