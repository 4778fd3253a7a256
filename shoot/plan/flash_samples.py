"""What each flash will show of each of the object's pixels: light vector, noise, and whether it is lit and no gloss."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from scene.lights import Lights
from shoot.plan.set_up import GLOSSES, SetUp
from solve.samples import GRAY
from twin.visibility import Sight

Array = NDArray[np.float64]
PIXELS = 1500
"""Of the object, evenly in the picture, that a plan is made for."""
RIM = 0.15
"""Cosine to the view under which a pixel is not counted: at the outline, half of it is something else."""
SHADOWED = 0.05
"""Share of a pixel's 75th percentile under which the default solver takes a sample for shadowed."""
OUTLIER, FLOOR = 2.5, 0.004
"""Of the default solver: sigmas from which gloss is left out, and the least sigma, share of what is bright."""
LEFT_BY_MOSAIC = np.array([0.5625, 0.625, 0.5625])
"""Of a sample's variance, mean over a Bayer pattern, red, green, blue: measured, or the mean of two or four."""


class Shown(NamedTuple):
    """F flashes at P pixels, each sample divided by its flash's intensity."""

    vectors: Array  # (F, P, 3) light vectors of intensity 1
    noise: Array  # (F, P) standard deviation, in units of albedo x vector
    seen: NDArray[np.bool_]  # (F, P)

    def only(self, flashes: NDArray) -> "Shown":
        """Return some of the flashes."""
        return Shown(self.vectors[flashes], self.noise[flashes], self.seen[flashes])

    def followed_by(self, other: "Shown") -> "Shown":
        """Return these flashes and others."""
        return Shown(
            np.concatenate([self.vectors, other.vectors]),
            np.concatenate([self.noise, other.noise]),
            np.concatenate([self.seen, other.seen]),
        )


def lights_at(positions: Array, reference: Array) -> Lights:
    """Return near lights of equal energy at positions (F, 3): the nearer, the brighter."""
    away = positions - reference
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    names = tuple(f"flash_{number:03d}" for number in range(1, len(positions) + 1))
    intensities = np.broadcast_to(1 / distance**2, (len(positions), 3))
    return Lights(names, away / distance, intensities, positions, np.asarray(reference, np.float64)).normalised()


@dataclass(frozen=True, eq=False)
class ObjectPixels:
    """The object's pixels for which a plan is made.

    `scatter`: standard deviation of a sample about its shading beside the sensor's noise, as a share of it.
    """

    set_up: SetUp
    points: Array  # (P, 3) mm
    normals: Array  # (P, 3) unit
    flat: Array  # (P, 3) the faces' own normals
    albedo: Array  # (P,)
    casts_shadows: bool = True
    scatter: float = 0.0

    @property
    def b(self) -> Array:
        """(P, 3) albedo x normal."""
        return self.albedo[:, None] * self.normals

    @cached_property
    def _views(self) -> Array:
        camera = self.set_up.camera
        if camera.is_orthographic:
            return np.broadcast_to([0.0, 0.0, 1.0], self.points.shape)
        return -self.points / np.linalg.norm(self.points, axis=1, keepdims=True)

    def under(self, lights: Lights) -> Shown:
        """Return what lights will show.

        Notes
        -----
        value = white x intensity x (albedo n.l + coat); white is `SetUp.white_value`. Its variance is value /
        electrons + read^2; gray is the channels' mean by `GRAY`, each divided by the intensity.
        """
        set_up, sensor = self.set_up, self.set_up.sensor
        vectors = np.asarray(lights.toward(self.points))
        shade = np.einsum("fpi,pi->fp", vectors, self.normals)
        if self.casts_shadows:
            attached, cast = Sight(set_up.mesh, set_up.camera, lights).shadows(self.points, self.normals, self.flat)
            seen = ~(attached | cast).T
        else:
            seen = shade > 0
        body, strength = self.albedo * np.maximum(shade, 0), lights.intensities.mean(1)[:, None]
        coat = self._coat(vectors)
        usual = np.quantile(np.where(seen, shade, 0), 0.75, axis=0)
        seen &= shade > SHADOWED * usual
        white = set_up.white_value
        neutral = np.array(sensor.neutral)
        value = white * strength * (body + coat)
        read = sensor.noise_e / sensor.white_e
        kept = LEFT_BY_MOSAIC if set_up.is_mosaic else np.ones(3)
        variance = np.einsum("c,fpc->fp", GRAY**2 * kept, value[..., None] * neutral / sensor.white_e + read**2)
        noise = np.sqrt(variance) / (white * strength * (GRAY @ neutral))
        seen &= value < 1
        bright = float(np.quantile(body[seen], 0.99)) if seen.any() else 1.0
        noise = np.hypot(noise, self.scatter * body)
        seen &= coat < OUTLIER * np.maximum(noise, FLOOR * bright)
        return Shown(vectors, noise, seen)

    def _coat(self, vectors: Array) -> Array:
        """Return what the gloss adds (F, P), in units of albedo x vector."""
        material = GLOSSES[self.set_up.gloss]
        if material is None:
            return np.zeros(vectors.shape[:2])
        from twin.material.reflection_models import coat, reflected

        roughness, specularity = material
        length = np.linalg.norm(vectors, axis=-1, keepdims=True)
        toward = np.ascontiguousarray((vectors / length).swapaxes(0, 1))
        gloss = reflected(coat(roughness), np.ascontiguousarray(self.normals), self._views.copy(), toward)[1]
        return specularity * gloss.T * length[..., 0]


def pixels_of(set_up: SetUp, count: int = PIXELS) -> ObjectPixels:
    """Return some of the pixels that show the object, evenly in the picture."""
    camera = set_up.camera
    corners = camera.project(set_up.mesh.vertices)
    low = np.floor(np.nanmin(corners, 0)).clip(0, [camera.width - 1, camera.height - 1])
    high = np.ceil(np.nanmax(corners, 0)).clip(1, [camera.width, camera.height])
    sight = Sight(set_up.mesh, camera, Lights.unknown(()))
    step = max(1.0, float(np.sqrt(np.prod(high - low) / (1.6 * count))))
    for _ in range(3):
        u, v = np.meshgrid(np.arange(low[0], high[0], step), np.arange(low[1], high[1], step))
        face, weights, points = sight.at(np.stack([u, v], -1).reshape(-1, 2))
        hit = face >= 0
        if hit.sum() <= count or step == 1:
            break
        step *= float(np.sqrt(hit.sum() / count))
    if not hit.any():
        raise SceneError("plan: the camera does not see the object. Check --distance-mm, --focal-mm and --unit.")
    face, weights, points = face[hit], weights[hit], points[hit]
    mesh = set_up.mesh
    normals = np.einsum("pc,pck->pk", weights, mesh.vertex_normals[mesh.faces[face]])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    flat = mesh.face_normals[face]
    toward = -points / np.linalg.norm(points, axis=1, keepdims=True)
    if camera.is_orthographic:
        toward = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    good = (np.sum(normals * toward, 1) > RIM) & (np.sum(flat * toward, 1) > 0)
    albedo = np.full(int(good.sum()), set_up.albedo)
    return ObjectPixels(set_up, points[good], normals[good], flat[good], albedo)
