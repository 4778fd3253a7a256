"""Rough plastic in closed form: what the renderer's material gives back, for fitting it to photographs.

The same numbers as `twin.description.materials.RoughPlastic` in Mitsuba (tests hold the two together to 1 %): pixel
values of a surface of reflectance 1 and specularity 1 under a light of intensity 1, in the units of
`twin.description.description.TwinScene`.
"""

from functools import lru_cache
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

INDEX = 1.49
"""twin.description.materials.RoughPlastic's own. Strength and index are hardly told apart: one is given."""
NODES = 64
"""Angles at which the coat's transmittance is tabulated, evenly in the cosine."""
FACETS = 48
"""Facets along either side of the square that is mapped to those that a direction sees."""


class Coat(NamedTuple):
    """A rough dielectric surface over a matte body [Walter2007].

    roughness: alpha of the GGX distribution.
    index: Of refraction.
    transmittance (NODES,): Share of the light that gets through, at cosines 0 to 1.
    body: Factor on the body's light: 1 / (index^2 (1 - R)), R the coat's diffuse reflectance from within.
    covered: Share of the body's light that passes it.
    """

    roughness: float
    index: float
    transmittance: Array
    body: float
    covered: float = 1.0


@lru_cache(256)
def coat(roughness: float, index: float = INDEX, *, covered: float = 1.0) -> Coat:
    """Return the coat of a roughness: its transmittance by quadrature over the facets that each direction sees."""
    cosine = np.maximum(np.linspace(0, 1, NODES), 1e-3)
    _, transmittance = _shares(cosine, roughness, index)
    # The plain mean over as many cosines, both ends counted, is the renderer's own: 2 % less than the integral.
    inside = float(np.mean(2 * cosine * _shares(cosine, roughness, 1 / index)[0]))
    return Coat(roughness, index, transmittance, 1 / (index**2 * (1 - inside)), covered)


def matte() -> Coat:
    """Return the coat that is none: all light gets through."""
    return Coat(1.0, 1.0, np.ones(NODES), 1.0)


def _shares(cosine: Array, roughness: float, index: float) -> tuple[Array, Array]:
    """Return what a rough boundary gives back, and lets through, of light from cosines (M,): met once, by its facets.

    The facets that a direction sees, evenly over their visible area [Heitz2018]; each splits light as Fresnel says, and
    what is masked on its way out is lost.
    """
    step = (np.arange(FACETS) + 0.5) / FACETS
    # Left and right of the direction are alike: one half stands for both.
    first, second = (part.ravel() for part in np.meshgrid(step, step[: FACETS // 2] - 0.25))
    sine = np.sqrt(1 - cosine**2)[:, None]
    stretched = np.stack([roughness * sine[:, 0], 0 * cosine, cosine], -1)
    stretched /= np.linalg.norm(stretched, axis=1, keepdims=True)
    x, z = stretched[:, :1], stretched[:, 2:]
    # A disc seen along the stretched direction, of which the part below the horizon is folded up.
    radius, angle = np.sqrt(first), 2 * np.pi * second
    across, up = radius * np.cos(angle), radius * np.sin(angle)
    fold = (1 + z) / 2
    up = (1 - fold) * np.sqrt(1 - across**2) + fold * up
    out = np.sqrt(np.maximum(1 - across**2 - up**2, 0))
    normal = np.stack([-z * up + x * out, np.broadcast_to(across, up.shape), x * up + z * out], -1)
    facet = np.stack([roughness * normal[..., 0], roughness * normal[..., 1], np.maximum(normal[..., 2], 1e-9)], -1)
    facet /= np.linalg.norm(facet, axis=-1, keepdims=True)
    toward = np.clip(sine * facet[..., 0] + cosine[:, None] * facet[..., 2], 0, 1)
    given_back = _fresnel(toward, index)
    reflected_z = 2 * toward * facet[..., 2] - cosine[:, None]
    beyond = np.sqrt(np.maximum(1 - (1 - toward**2) / index**2, 0))
    refracted_z = cosine[:, None] / index - (toward / index - beyond) * facet[..., 2]
    return tuple(
        np.mean(share * np.where(z > 0, _masking(np.maximum(z, 1e-6), roughness), 0), 1)
        for share, z in ((given_back, reflected_z), (1 - given_back, refracted_z))
    )  # type: ignore[return-value]


def _masking(cosine: Array, roughness: float) -> Array:
    return 2 / (1 + np.sqrt(1 + roughness**2 * (1 / cosine**2 - 1)))


def _fresnel(cosine: Array, index: float) -> Array:
    """Return the reflectance of a smooth boundary for unpolarised light; 1 beyond the critical angle."""
    square = index**2 - 1 + cosine**2
    g = np.sqrt(np.maximum(square, 0))
    across = (cosine - g) / np.maximum(cosine + g, 1e-12)
    along = (index**2 * cosine - g) / np.maximum(index**2 * cosine + g, 1e-12)
    return np.where(square > 0, (across**2 + along**2) / 2, 1.0)


@numba.njit(nogil=True, cache=True, inline="always")
def shade(normal, view, light, roughness, surface):
    """Return the body's and the coat's pixel values for unit normal, view and light: factors of albedo and strength.

    Body: cos_l (1 - covered + covered T(l) T(v) / (index^2 (1 - R))); coat: pi F D G / (4 cos_v), G by Smith, each
    direction apart. The matte coat (index 1) has the body cos_l and no coat.
    """
    nx, ny, nz = normal
    vx, vy, vz = view
    lx, ly, lz = light
    index, transmittance, covered = surface.index, surface.transmittance, surface.covered
    nl = nx * lx + ny * ly + nz * lz
    nv = nx * vx + ny * vy + nz * vz
    if nl <= 0 or nv <= 0:
        return 0.0, 0.0
    last = len(transmittance) - 1
    at, seen = min(nl, 1.0) * last, min(nv, 1.0) * last
    i, j = min(int(at), last - 1), min(int(seen), last - 1)
    t_in = transmittance[i] + (at - i) * (transmittance[i + 1] - transmittance[i])
    t_out = transmittance[j] + (seen - j) * (transmittance[j + 1] - transmittance[j])
    diffuse = nl * (1 - covered + covered * t_in * t_out * surface.body)
    if index == 1.0:
        return diffuse, 0.0
    hx, hy, hz = vx + lx, vy + ly, vz + lz
    length = np.sqrt(hx * hx + hy * hy + hz * hz)
    nh = (nx * hx + ny * hy + nz * hz) / length
    c = (hx * lx + hy * ly + hz * lz) / length
    g = np.sqrt(index * index - 1 + c * c)
    across, along = (c - g) / (c + g), (index * index * c - g) / (index * index * c + g)
    fresnel = (across * across + along * along) / 2
    a2 = roughness * roughness
    bottom = nh * nh * (a2 - 1) + 1
    facets = a2 / (np.pi * bottom * bottom)
    g_l = 2 / (1 + np.sqrt(1 + a2 * (1 / (nl * nl) - 1)))
    g_v = 2 / (1 + np.sqrt(1 + a2 * (1 / (nv * nv) - 1)))
    return diffuse, np.pi * fresnel * facets * g_l * g_v / (4 * nv)


@numba.njit(nogil=True, cache=True)
def reflected(surface, normals, views, lights):
    """Return (P, F) body and (P, F) coat of normals (P, 3), views (P, 3) and unit lights (P, F, 3)."""
    count, frames = lights.shape[:2]
    diffuse, gloss = np.empty((count, frames), np.float32), np.empty((count, frames), np.float32)
    for p in range(count):
        normal = normals[p, 0], normals[p, 1], normals[p, 2]
        view = views[p, 0], views[p, 1], views[p, 2]
        for f in range(frames):
            light = lights[p, f, 0], lights[p, f, 1], lights[p, f, 2]
            diffuse[p, f], gloss[p, f] = shade(normal, view, light, surface.roughness, surface)
    return diffuse, gloss
