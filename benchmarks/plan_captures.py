"""A planned shoot, photographed by the virtual camera: balls on a table, and a mesh among them, with cast shadows."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibrate.calibrate import calibrate
from experiments.shapes import SHAPES
from fixtures.ball_scene import World, develop, radiance
from lab.shoot.ball_places import light_sigmas, stand_balls
from lab.shoot.flash_places import Reach
from lab.shoot.flash_samples import RIM, ObjectPixels, lights_at
from lab.shoot.set_up import GLOSSES, SetUp
from lab.shoot.shoot_plan import Predicted, joint_covariance, light_slopes, plan_shoot, predict
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.spheres import Kind, Sphere
from solve.solve import solve
from twin.camera.virtual_camera import Sensor
from twin.visibility import Sight

Array = NDArray[np.float64]
WIDTH, HEIGHT, DISTANCE_MM = 480, 320, 1000.0
CAMERA = Camera(WIDTH, HEIGHT, 1.6 * WIDTH, 1.6 * WIDTH, WIDTH / 2 - 0.5, HEIGHT / 2 - 0.5)
TABLE_ALBEDO = 0.08
EXPOSURE = 0.55
"""Value of a surface of reflectance 1 facing the mean flash: the white ball stays below white under all."""
HAND_MM = 6.0
"""Standard deviation of a flash beside its planned place, and of a ball beside its own."""


@dataclass(frozen=True)
class Case:
    """A set-up to be predicted, and photographed again and again."""

    name: str
    shape: str  # of `experiments.shapes.SHAPES`, or "sphere"
    layout: str  # of flashes: dome, ring, free (drawn at random), plan (chosen by `plan_shoot`)
    flashes: int
    chrome_mm: tuple[float, ...] = (60.0, 60.0, 60.0)
    iso: float = 400.0
    gloss: str = "matte"
    albedo: float = 0.5
    size_mm: float = 120.0
    relief: float = 0.6
    flash_mm: float = 900.0
    seed: int = 0

    @cached_property
    def set_up(self) -> SetUp:
        """Object, camera, noise."""
        return SetUp(
            CAMERA, _mesh(self), Sensor(iso=self.iso), self.gloss, self.albedo, white_value=EXPOSURE, is_mosaic=True
        )

    @cached_property
    def reach(self) -> Reach:
        """Where its flashes are."""
        layout = "ring" if self.layout == "ring" else "dome"
        return Reach(layout, to_deg=55.0 if layout == "ring" else 62.0, distance_mm=self.flash_mm)

    @cached_property
    def spheres(self) -> list[Sphere]:
        """Where the balls are to stand."""
        kinds: list[tuple[Kind, float]] = [("chrome", one) for one in self.chrome_mm]
        middle, size = self.set_up.middle_mm, self.set_up.size_mm
        return stand_balls(self.set_up, self.reach.positions(middle, size), [*kinds, ("white", self.chrome_mm[0])])

    @cached_property
    def positions(self) -> Array:
        """(F, 3) where the flashes are to be."""
        middle, size = self.set_up.middle_mm, self.set_up.size_mm
        if self.layout == "plan":
            pixels = replace(
                self.pixels, **{k: getattr(self.pixels, k)[::4] for k in ("points", "normals", "flat", "albedo")}
            )
            return plan_shoot(pixels, self.spheres, self.reach, self.flashes).positions_mm[: self.flashes]
        if self.layout == "free":
            rng = np.random.default_rng([self.seed, 1])
            found = self.reach.positions(middle, size, 200)
            found = found[rng.permutation(len(found))[: self.flashes]]
            return middle + (found - middle) * rng.uniform(0.85, 1.2, (len(found), 1))
        return self.reach.positions(middle, size, self.flashes)

    @cached_property
    def _seen(self) -> tuple[NDArray[np.bool_], Array, Array, Array]:
        """Return the object's mask (H, W), and of its pixels points, normals, faces' normals (P, 3)."""
        mesh = self.set_up.mesh
        face, weights, points = Sight(mesh, CAMERA, Lights.unknown(())).at(CAMERA.grid())
        mask = face >= 0
        normals = np.einsum("pc,pck->pk", weights[mask], mesh.vertex_normals[mesh.faces[face[mask]]])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return mask, points[mask], normals, mesh.face_normals[face[mask]]

    @cached_property
    def judged(self) -> NDArray[np.bool_]:
        """(H, W) the pixels whose normals are judged: not at the object's outlines, where two surfaces mix."""
        import cv2

        mask, points, normals, _ = self._seen
        depth, steep = np.zeros(mask.shape, np.float32), np.zeros(mask.shape, bool)
        depth[mask] = points[:, 2]
        toward = -points / np.linalg.norm(points, axis=1, keepdims=True)
        steep[mask] = np.sum(normals * toward, 1) < max(RIM, 0.3)
        kernel = np.ones((5, 5), np.uint8)
        jump = cv2.dilate(depth, kernel) - cv2.erode(depth, kernel) > 0.08 * self.size_mm
        return cv2.erode((mask & ~steep & ~jump).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0

    @cached_property
    def pixels(self) -> ObjectPixels:
        """The judged pixels, as a plan has them."""
        mask, *parts = self._seen
        points, normals, flat = (part[self.judged[mask]] for part in parts)
        return ObjectPixels(self.set_up, points, normals, flat, np.full(len(points), self.albedo))

    def predicted(self) -> tuple[Predicted, float]:
        """Return what `rgbn plan` says of it, and of the lights' directions: sigma, degrees, median flash."""
        middle = self.set_up.middle_mm
        known = light_sigmas(self.set_up, self.spheres, self.positions)
        shown = self.pixels.under(lights_at(self.positions, middle))
        slopes = light_slopes(self.positions, middle, self.pixels.points, self.pixels.b)
        return predict(self.pixels, shown, slopes, joint_covariance(known)), float(np.median(known.direction_sigma_deg))

    def photograph(self, run: int) -> tuple[Frames, World, Array]:
        """Return one shoot: frames, the world as it truly stood, and the flashes' true places (F, 3)."""
        rng = np.random.default_rng([self.seed, 7, run])
        middle, count = self.set_up.middle_mm, self.flashes
        positions = self.positions + HAND_MM * rng.standard_normal(self.positions.shape)
        distance = np.linalg.norm(positions - middle, axis=1)
        # Flashes of one energy: white that faces the mean one at the object shows EXPOSURE.
        power = EXPOSURE / np.mean((1000 / distance) ** 2) * np.ones((count, 3))
        table = np.array([0.0, 0.0, self.set_up.table_mm])
        world = World(
            CAMERA, [], positions, power, table_point=table, table_normal=np.array([0.0, 0.0, 1.0]),
            table_albedo=TABLE_ALBEDO, table_texture="noise",
        )  # fmt: skip
        for sphere in self.spheres:
            x, y, _ = sphere.center_mm(CAMERA)
            aside = HAND_MM * rng.standard_normal(2)
            world.stand(sphere.kind, x + aside[0], y + aside[1], sphere.radius_mm)
        sensor = self.set_up.sensor
        images, _ = radiance(world, blur_px=sensor.blur_px)
        mask = self._seen[0]
        behind = replace(sensor, blur_px=0.0)
        codes = []
        for image, place in zip(images, positions, strict=True):
            image[mask] = (self._object_under(place) * power[0, 0])[:, None]
            codes.append(develop(image, behind, rng))
        names = tuple(f"flash_{i:03d}" for i in range(count))
        return Frames(names, np.stack(codes), np.ones(count), None, is_mosaic=True), world, positions

    def _object_under(self, place: Array) -> Array:
        """Return the object's values (P,) under a flash at a place (3,) of power 1: white at 1 m shows 1."""
        from twin.material.reflection_models import coat, reflected

        _, points, normals, flat = self._seen
        lights = lights_at(place[None], self.set_up.middle_mm)
        attached, cast = Sight(self.set_up.mesh, CAMERA, lights).shadows(points, normals, flat)
        toward = place - points
        far = np.linalg.norm(toward, axis=1, keepdims=True)
        toward /= far
        value = self.albedo * np.sum(toward * normals, 1)
        material = GLOSSES[self.gloss]
        if material is not None:
            views = -points / np.linalg.norm(points, axis=1, keepdims=True)
            value = value + material[1] * reflected(coat(material[0]), normals, views, toward[:, None])[1][:, 0]
        return np.where(attached[:, 0] | cast[:, 0], 0.0, np.maximum(value, 0) * (1000 / far[:, 0]) ** 2)

    def normals(self, run: int) -> tuple[Array, Array, float]:
        """Return one shoot's normals (P, 3) at the judged pixels, NaN where unknown; lights' errors, stated sigma."""
        frames, world, positions = self.photograph(run)
        middle = self.set_up.middle_mm
        found = calibrate(frames, CAMERA, world.requests(hints=True))
        lights = found.lights.seen_from(middle)
        estimate = solve("iterative", frames, lights, CAMERA, self.judged)
        true = positions - middle
        true /= np.linalg.norm(true, axis=1, keepdims=True)
        off = np.degrees(np.arccos(np.clip(np.sum(true * lights.directions, 1), -1, 1)))
        return estimate.normals[self.judged].astype(np.float64), off, float(np.median(found.lights.direction_sigma_deg))


def _mesh(case: Case) -> Mesh:
    """Return the case's object before the camera."""
    if case.shape == "sphere":
        from lab.shoot.set_up import simple_shape

        mesh = simple_shape("sphere", case.size_mm)
    else:
        shape = SHAPES[case.shape](case.relief)
        mesh = Mesh(shape.vertices * case.size_mm / 2, np.asarray(shape.faces, np.int64))
    shift = np.array([0, 0, -DISTANCE_MM]) - mesh.center_mm
    return Mesh(mesh.vertices + shift, mesh.faces)
