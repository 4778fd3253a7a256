"""Rough plastic in closed form: what the renderer's material gives back, for fitting it to photographs.

The same numbers as `twin.description.materials.RoughPlastic`, of a metal `Principled`, in Mitsuba (tests hold the two
together to 1 %): pixel values of a surface of reflectance 1 and specularity 1 under a light of intensity 1, in units of
`twin.description.description.TwinScene`.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from scene import microfacets
from scene.microfacets import VECTORS
from twin.description.materials import RoughPlastic
from twin.engines.mitsuba_materials import bsdf
from twin.engines.mitsuba_scene import loadable
from twin.engines.variant import SLOW, import_mitsuba

Array = NDArray[np.float64]

INDEX = 1.49
"""twin.description.materials.RoughPlastic's own. Strength and index are hardly told apart: one is given."""
NODES = 64
"""Angles at which the coat's transmittance is tabulated, evenly in the cosine."""
TABLED = np.geomspace(0.01, 1, 17)
"""Roughnesses of which the renderer tells the transmittance; a smoother coat has that of the smoothest."""
LAMBERT = -1.0
"""Stands for the roughness of a body that has none."""
facets = numba.njit(**VECTORS)(microfacets.facets)
SHADED = 6
"""Rows that `shade` works in."""


class Coat(NamedTuple):
    """A rough dielectric surface over a matte body [Walter2007].

    roughness: alpha of the facets' distribution.
    index: Of refraction.
    transmittance (NODES,): Share of the light that gets through, at cosines 0 to 1, over index sqrt(1 - R): R is the
        coat's diffuse reflectance from within.
    body: Roughness of a body that lies bare, 0 to 1, by the law of [Burley2012]; -1: it is Lambert's, below the coat.
    is_metal: There is no body below: the facets reflect its albedo.
    """

    roughness: float
    index: float
    transmittance: Array
    body: float = LAMBERT
    is_metal: bool = False

    def changed(self, **new: Any) -> "Coat":
        """Return the coat with other numbers, by their names in `coat`."""
        numbers = {name: getattr(self, name) for name in ("roughness", "index", "body", "is_metal")}
        return coat(**{**numbers, **new})

    def numbers(self) -> dict[str, Any]:
        """Return its numbers by the names of `twin.description.materials.RoughPlastic`."""
        body = None if self.body < 0 else self.body
        return {"roughness": self.roughness, "index": self.index, "body_roughness": body}


def coat(roughness: float, index: float = INDEX, *, body: float = LAMBERT, is_metal: bool = False) -> Coat:
    """Return the coat of a roughness; see `Coat`."""
    where = np.log(np.clip(roughness, TABLED[0], TABLED[-1]))
    return Coat(roughness, index, np.asarray(_transmittances(index)(where).real, np.float64), body, is_metal)


@lru_cache(16)
def _transmittances(index: float) -> CubicSpline:
    """Return what gives the transmittance (NODES,) of a roughness' logarithm: to 0.03 % the renderer's own, see `Coat`.

    The body of reflectance 1, seen from where it is lit, has the value cos T(cos)^2 / (index^2 (1 - R)).
    """
    return CubicSpline(np.log(TABLED), [_transmittance(float(roughness), index) for roughness in TABLED])


def _transmittance(roughness: float, index: float) -> Array:
    mi = import_mitsuba(slow=True)
    material = RoughPlastic((1.0, 1.0, 1.0), roughness, 0.0, index)
    plastic = mi.load_dict(loadable(mi, bsdf(material)))
    cosine = np.maximum(np.linspace(0, 1, NODES), 1e-3)
    toward = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine]).astype(np.float32)
    surface, context = mi.SurfaceInteraction3f(), mi.BSDFContext()
    if mi.variant() == SLOW:
        values = np.empty(NODES)
        for node, one in enumerate(toward.T):
            surface.wi = mi.Vector3f(one)
            values[node] = plastic.eval(context, surface, surface.wi)[0]
    else:
        surface.wi = mi.Vector3f(toward)
        values = np.asarray(plastic.eval(context, surface, surface.wi))[0]
    return np.asarray(np.sqrt(np.pi * values / cosine), np.float64)


def matte() -> Coat:
    """Return the coat that is none: all light gets through."""
    return Coat(1.0, 1.0, np.ones(NODES))


@numba.njit(nogil=True, cache=True, inline="always")
def _looked_up(table, cosine):
    """Return a table's value at a cosine, linear between its nodes."""
    at = max(min(cosine, 1.0), 0.0) * (len(table) - 1)
    i = min(int(at), len(table) - 2)
    return table[i] + (at - i) * (table[i + 1] - table[i])


@numba.njit(**VECTORS)
def _body(surface, cosines, nv, out):
    """Fill `out` (F,) with the body's value under each light; `cosines` as `shade` has them."""
    nl, c = cosines[0], cosines[1]
    if surface.body < 0:
        of_view = _looked_up(surface.transmittance, nv)
        for f in range(len(out)):
            out[f] = nl[f] * of_view * _looked_up(surface.transmittance, nl[f])
        return
    for f in range(len(out)):
        # A rough body's value over Lambert's [Burley2012].
        grazing = 2 * surface.body * c[f] * c[f] - 0.5
        toward, from_it = 1 - min(nl[f], 1.0), 1 - min(nv, 1.0)
        out[f] = nl[f] * (1 + grazing * toward**5) * (1 + grazing * from_it**5)


@numba.njit(nogil=True, cache=True, inline="always")
def vector(row):
    """Return a row's three numbers."""
    return np.float64(row[0]), np.float64(row[1]), np.float64(row[2])


@numba.njit(**VECTORS)
def shade(normal, view, lights, roughness, surface, out):
    """Fill out[0] and out[1] with the body's and the coat's pixel values under each light: of albedo and strength 1.

    Body: cos_l T(l) T(v), or, bare, cos_l B of [Burley2012]; of a metal, pi D G / (4 cos_v),
    which leaves out that it reflects more at grazing angles. Coat: pi F D G / (4 cos_v), G by Smith, each direction
    apart; D and G of GGX [Walter2007]. The matte coat (index 1) has the body cos_l and no coat.

    normal, view: Unit, three numbers each.
    lights (F, 3): Unit.
    roughness: That of the surface, with what is added to it here.
    out (SHADED, F): Its other rows are scratch. All is done light by light in loops without exceptions, of which the
        compiler makes vector instructions.
    """
    nx, ny, nz = normal
    vx, vy, vz = view
    nv = nx * vx + ny * vy + nz * vz
    if nv <= 0:
        out[:2] = 0
        return
    index, cosines, fresnel, diffuse, gloss = surface.index, out[2:5], out[5], out[0], out[1]
    for f in range(lights.shape[0]):
        lx, ly, lz = lights[f, 0], lights[f, 1], lights[f, 2]
        hx, hy, hz = vx + lx, vy + ly, vz + lz
        length = np.sqrt(hx * hx + hy * hy + hz * hz)
        c = (hx * lx + hy * ly + hz * lz) / length
        cosines[0, f] = nx * lx + ny * ly + nz * lz
        cosines[1, f] = c
        cosines[2, f] = (nx * hx + ny * hy + nz * hz) / length
        g = np.sqrt(index * index - 1 + c * c)
        across, along = (c - g) / (c + g), (index * index * c - g) / (index * index * c + g)
        fresnel[f] = (across * across + along * along) / 2
    _body(surface, cosines, nv, diffuse)
    facets(roughness * roughness, cosines[0], cosines[2], nv, gloss)
    for f in range(len(gloss)):
        lit = cosines[0, f] > 0
        mirrored = np.pi * gloss[f] / (4 * nv) if lit else 0.0
        diffuse[f] = mirrored if surface.is_metal else diffuse[f] if lit else 0.0
        gloss[f] = fresnel[f] * mirrored if lit else 0.0


@numba.njit(nogil=True, cache=True)
def reflected(surface, normals, views, lights):
    """Return (P, F) body and (P, F) coat of normals (P, 3), views (P, 3) and unit lights (P, F, 3)."""
    count, frames = lights.shape[:2]
    diffuse, gloss = np.empty((count, frames), np.float32), np.empty((count, frames), np.float32)
    out = np.empty((SHADED, frames))
    for p in range(count):
        shade(vector(normals[p]), vector(views[p]), lights[p], surface.roughness, surface, out)
        diffuse[p], gloss[p] = out[0], out[1]
    return diffuse, gloss
