"""The world that an answer describes, and the photographs that it predicts."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.frames import Frames, encode
from scene.lights import Lights
from scene.mesh import Mesh
from scene.rays import RayCaster
from solve.problem import Problem
from solve.samples import all_samples
from solve.surface.integration import integrate
from solve.surface.surface_mesh import mesh_of
from solve.trust.shading import Geometry, albedo_of
from solve.whole import reflectance
from solve.whole.interreflection import Relief

PATCHES = 1200
"""Of the surface, that throw light upon each other."""
BY_WHITE, GUESSED = 0.1, 0.5
"""Relative standard deviation of the light thrown, where a white ball tells the reflectance, and `reflectance` found no
fault with it; and where not.
"""
LARGEST_CODE = 1.05
"""Linear value that 16-bit codes still hold."""
LIFT = 0.5
"""Of a pixel's width: how far shadow rays start from the surface."""


@dataclass(frozen=True)
class Material:
    """How the object reflects, and the lights that are taken to be true.

    Parameters
    ----------
    problem : Problem
        With near lights at their places, and each pixel's depth, where `reflectance` found them.
    depth_mm : float
        z of the surface's middle.
    shared : (SIZE,) float64
        See `solve.whole.reflectance.fit_to_views`.
    white : float or None
        The gray value of a reflectance of 1, where it decides how much light the object throws upon itself.
    doubt : float
        Relative standard deviation of that light.
    """

    problem: Problem
    depth_mm: float
    shared: NDArray
    white: float | None
    doubt: float = GUESSED

    @classmethod
    def of(cls, problem: Problem) -> "Material":
        """Return what `reflectance` finds in a problem."""
        settings = reflectance.METHOD.settings("default")
        problem = reflectance.prepare(problem, settings)
        depth, relief = reflectance.relief_of(problem, settings)
        white = reflectance.white_gray(problem.lights)
        whole, shared = reflectance.fit_to_views(all_samples(problem), problem.views(), settings, relief, white)
        white = white if reflectance.is_matte(shared) else None
        return cls(problem, depth, shared, white, GUESSED if white is None or whole.cautions else BY_WHITE)


@dataclass(frozen=True)
class World:
    """A surface of a material under lights, as P of the problem's pixels see it.

    Parameters
    ----------
    problem : Problem
        Its mask (H, W) has those P pixels.
    normals : (P, 3) float64
        As given: the truth of this world.
    toward : (P, F, 3) float64
        The lights' vectors.
    lit : (P, F) bool
        Before the surface, not behind another part of it, and not clipped.
    albedo : (P,) float64
    thrown : (P, F) float64
        Light from the object's other parts, of a pixel whose albedo is 1.
    gray, predicted : (P, F) float64
        Photographed; and what this world shows.
    doubt : float
        Relative standard deviation of `thrown`.
    """

    problem: Problem
    normals: NDArray
    toward: NDArray
    lit: NDArray[np.bool_]
    albedo: NDArray
    thrown: NDArray
    gray: NDArray
    predicted: NDArray
    doubt: float

    @property
    def unexplained(self) -> float:
        """By how much the lit samples differ from the predicted ones, rms over rms."""
        gap = np.where(self.lit, self.gray - self.predicted, 0)
        return float(np.sqrt(np.sum(gap**2) / max(np.sum(np.where(self.lit, self.gray, 0) ** 2), 1e-300)))

    def photographs(self, colors: NDArray) -> Frames:
        """Return the frames of this world; `colors` (P, 3): each channel's value where gray is 1.

        They are clipped where the photographs are.
        """
        frames, lights = self.problem.frames, self.problem.lights
        codes = np.zeros((len(frames), *self.problem.mask.shape, 3), np.uint16)
        for index, code in enumerate(codes):
            image = np.zeros((*self.problem.mask.shape, 3))
            image[self.problem.mask] = self.predicted[:, index, None] * colors * lights.intensities[index]
            code[:] = encode(image / frames.gain[index])
        return Frames(frames.names, codes, frames.gain, None, min(frames.saturation, LARGEST_CODE))


def world_of(normals: NDArray, material: Material) -> World:
    """Return the world of normals (H, W, 3), NaN where unknown: such pixels are not part of it.

    Notes
    -----
    The normals shade; their integral, a surface torn at edges of depth, casts the shadows, found by rays. All parts
    throw light upon each other as bright as they were photographed, shadows, gloss and further bounces with them
    [Nayar1991]. Albedos are fitted to the photographs.
    """
    problem, shared = material.problem, material.shared
    camera, lights = problem.camera, problem.lights
    known = problem.mask & np.isfinite(normals).all(-1)
    surface = integrate(normals, known, camera, z_mm=material.depth_mm)
    inside = np.isfinite(surface.z_mm)
    problem = replace(problem, mask=inside, z_mm=surface.z_mm)
    drawn = mesh_of(surface, normals, np.ones((*inside.shape, 3)), camera)
    truth = drawn.normals
    samples = all_samples(problem)
    gray, toward = samples.gray.astype(np.float64), np.array(samples.toward())
    geometry = Geometry.of(truth, problem.views(), toward)
    clear = (geometry.cosine > 0) & ~_shadowed(Mesh(drawn.vertices, drawn.faces), truth, toward, lights, camera)
    lit = clear & samples.valid
    direct = geometry._replace(cosine=np.where(clear, geometry.cosine, 0.0))
    albedo = albedo_of(direct, gray, lit, shared)
    relief = Relief(inside, camera, material.depth_mm, PATCHES)
    chosen = relief.patches(np.ones(len(gray), bool))
    brightest = float(np.percentile(albedo, 95))
    light = relief.throw(chosen, samples.gray[chosen] / np.float32(brightest), truth[chosen])
    share = shared[-1] if material.white is None else min(brightest / material.white, 1.0)
    thrown = share * np.einsum("pcf,pc->pf", light.patches[light.corner], light.share)
    albedo = albedo_of(direct, gray, lit, shared, thrown)
    predicted = albedo[:, None] * (direct.cosine * direct.reflectance(shared) + thrown)
    return World(problem, truth, toward, lit, albedo, thrown, gray, predicted, material.doubt)


def _shadowed(mesh: Mesh, normals: NDArray, toward: NDArray, lights: Lights, camera: Camera) -> NDArray[np.bool_]:
    """Return (P, F) whether the surface stands between a vertex that faces a light and the light."""
    caster, points = RayCaster(mesh), mesh.vertices
    lift = LIFT * (1.0 if camera.is_orthographic else float(np.median(np.abs(points[:, 2])))) / camera.fx
    out = np.zeros(toward.shape[:2], bool)
    for index in range(len(lights)):
        facing = np.einsum("pi,pi->p", toward[:, index], normals) > 0
        way = toward[facing, index]
        way = way / np.linalg.norm(way, axis=1, keepdims=True)
        start = points[facing] + lift * (normals[facing] + way)
        end = None if lights.positions_mm is None else lights.positions_mm[index]
        far = np.inf if end is None else np.linalg.norm(end - start, axis=1)
        out[facing, index] = caster.blocked(start, way, far)
    return out
