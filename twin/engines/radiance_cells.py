"""What surfaces send on under every flash at once, kept in small cells of space: light's second and later bounces.

A path from the camera that leaves the first surface meets a second one somewhere. What that sends back is needed for
all flashes, but neighbouring paths need nearly the same: so it is found once for a cell of space, at a few of the
points that paths met there, and every path that ends in the cell takes the mean [Keller2016]. Cells are small against
the distance that they are seen from. Between cells light is exchanged in the same way, bounce by bounce.
"""

import copy
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from twin.engines.flash_shading import Flashes, add_whole

EMPTY = np.int64(-1)
NOWHERE = np.int64(-2)
"""Key of a sample that meets nothing."""
ANGLE = 0.15
"""Side of a cell over the distance that it is seen from."""
COARSEST = 1 / 16
"""Side of the largest cells, of the scene's diagonal; each level below has half of it."""
LEVELS = 6
POINTS = 2, 8
"""Of a cell, so many points are lit at most: by how many paths a pixel has."""
BOUNCES = 4
"""Rays that go on from each of them."""


@dataclass(frozen=True)
class Hits:
    """Where rays that leave a surface meet the next one.

    keys (S,): Of the cell; NOWHERE if there is none.
    weights (S, 3): BRDF times cosine over the density that the direction was drawn with.
    origins, directions (S, 3): The rays.
    glossy (S,): What is met there sends light on by its direction.
    """

    keys: NDArray[np.int64]
    weights: NDArray[np.float32]
    origins: NDArray[np.float32]
    directions: NDArray[np.float32]
    glossy: NDArray[np.bool_]

    def only(self, chosen: NDArray[np.intp]) -> "Hits":
        """Return some of them."""
        return Hits(*(getattr(self, field.name)[chosen] for field in fields(self)))


class RadianceCells:
    """The cells of a scene that have been met so far.

    bounces: How often light is sent on after the first surface that it meets and before the one that the camera sees.
    paths: A pixel's; where these are few, a cell's own noise is less than theirs with few points too.
    """

    def __init__(self, mi: Any, scene: Any, flashes: Flashes, *, bounces: int, paths: int, seed: int = 0) -> None:
        self._mi, self._scene, self._flashes = mi, scene, flashes
        self._points = int(np.clip(paths // 8, *POINTS))
        self._bounces, self._seed = bounces, seed
        low, high = np.array(scene.bbox().min).ravel(), np.array(scene.bbox().max).ravel()
        self._side = COARSEST * float(np.linalg.norm(high - low))
        self._corner = low - self._side
        self._table, self._cell_of_slot = np.full(1 << 16, EMPTY), np.zeros(1 << 16, np.int32)
        self._keys = np.zeros(0, np.int64)
        self._direct = np.zeros((0, 3, flashes.count), np.float32)
        self._links: list[tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.int32]]] = []
        self.radiance = self._direct
        """(C, 3, F), of each cell toward where it was seen from."""
        self.radiance_before = self._direct
        """Likewise, of light that was sent on once less."""

    def __len__(self) -> int:
        return len(self._keys)

    def copy(self) -> "RadianceCells":
        """Return the cells as they stand: what one of the two learns later, the other does not know."""
        other = copy.copy(self)
        # All else is replaced when cells come in; these are written to.
        other._table, other._cell_of_slot = self._table.copy(), self._cell_of_slot.copy()
        other._links = list(self._links)
        return other

    def leave(self, surface: Any, active: Any, sampler: Any) -> Hits:
        """Send a ray on from each surface point, drawn by its BRDF."""
        import drjit as dr

        mi = self._mi
        bsdf = surface.bsdf()
        drawn, weight = bsdf.sample(mi.BSDFContext(), surface, sampler.next_1d(), sampler.next_2d(), active)
        ray = surface.spawn_ray(surface.to_world(drawn.wo))
        active = active & (dr.max(weight) > 0)
        met = self._scene.ray_intersect(ray, mi.RayFlags.Minimal, False, active)
        active &= met.is_valid()
        level = dr.clip(dr.floor(dr.log2(self._side / (ANGLE * met.t))) + 1, 0, LEVELS - 1)
        scale = dr.exp2(level) / self._side
        place = mi.Vector3u((ray(met.t) - mi.Point3f(*self._corner.tolist())) * scale)
        # The two sides of a thin wall, and walls that meet in an edge, are lit differently.
        normal = dr.select(dr.dot(met.n, ray.d) > 0, -met.n, met.n)
        size = dr.abs(normal)
        axis = dr.select(size.x >= dr.maximum(size.y, size.z), 0, dr.select(size.y >= size.z, 1, 2))
        facing = dr.select(axis == 0, normal.x, dr.select(axis == 1, normal.y, normal.z)) > 0
        kind = mi.UInt64(mi.UInt32(level) * 8 + mi.UInt32(axis) * 2 + dr.select(facing, mi.UInt32(1), mi.UInt32(0)))
        key = (kind << 48) | (mi.UInt64(place.x) << 32) | (mi.UInt64(place.y) << 16) | mi.UInt64(place.z)
        key: Any = dr.select(active, mi.Int64(key), int(NOWHERE))
        weight = dr.select(active, weight, 0)
        glossy: Any = active & mi.has_flag(met.bsdf().flags(), mi.BSDFFlags.Glossy)
        rows: list[Any] = [dr.ravel(weight), dr.ravel(ray.o), dr.ravel(ray.d)]
        dr.eval(key, glossy, *rows)
        weight, origins, directions = (row.numpy().reshape(-1, 3) for row in rows)
        return Hits(key.numpy(), weight, origins, directions, glossy.numpy())

    def arrive(self, hits: Hits) -> Any:
        """Return the surfaces that the rays meet, as Mitsuba has them."""
        mi = self._mi
        origins, directions = (np.ascontiguousarray(a.T) for a in (hits.origins, hits.directions))
        return self._scene.ray_intersect(mi.Ray3f(mi.Point3f(origins), mi.Vector3f(directions)))

    def reflected(self, surface: Any, owners: NDArray, weights: NDArray[np.float32], count: int) -> NDArray[np.float32]:
        """Return (count, 3, F): light straight from the flashes, times weights (S, 3), summed for each owner (S,)."""
        import drjit as dr

        mi, flashes, bsdf = self._mi, self._flashes, surface.bsdf()
        out, parts = dr.zeros(mi.UInt64, count * 3 * flashes.count), mi.Float(flashes.parts)
        owner, weight = mi.UInt32(owners.astype(np.uint32)), mi.Color3f(np.ascontiguousarray(weights.T))

        def add(light: Any, active: Any) -> None:
            value = flashes.reflected(self._scene, surface, bsdf, light, active, coherent=False) * weight
            value *= dr.gather(mi.Float, parts, light, active)
            add_whole(mi, out, lambda channel: (owner * 3 + channel) * flashes.count + light, value, active)

        flashes.loop(flashes.count, surface.is_valid(), add)
        whole = out.numpy().reshape(-1, 3, flashes.count)
        return np.multiply(whole, 1 / flashes.parts, dtype=np.float32, casting="unsafe")

    def cells(self, hits: Hits, pool: ThreadPoolExecutor) -> NDArray[np.int32]:
        """Return each hit's cell, -2 where there is none; cells that were not met before are lit first."""
        found = self._find(hits.keys, pool)
        unknown = np.nonzero(found == -1)[0]
        if len(unknown):
            self._learn(hits, unknown, pool)
            found[unknown] = self._find(hits.keys[unknown], pool)
        return found

    def _find(self, keys: NDArray[np.int64], pool: ThreadPoolExecutor) -> NDArray[np.int32]:
        found = np.empty(len(keys), np.int32)
        pieces = [slice(start, start + (1 << 16)) for start in range(0, len(keys), 1 << 16)]
        list(pool.map(lambda piece: find(self._table, self._cell_of_slot, keys[piece], found[piece]), pieces))
        return found

    def _learn(self, hits: Hits, chosen: NDArray[np.intp], pool: ThreadPoolExecutor) -> None:
        """Light the cells of the chosen hits, those that these see, and so on; then let them exchange light."""
        for turn in range(self._bounces + 1):
            hits, owners = self._light(hits, chosen, go_on=turn < self._bounces)
            if not len(owners):
                break
            self._links.append((hits.keys, hits.weights, owners))
            chosen = np.nonzero(self._find(hits.keys, pool) == -1)[0]
            if not len(chosen):
                break
        radiance = before = self._direct
        links = [(self._find(keys, pool), weights, owners) for keys, weights, owners in self._links]
        for _ in range(self._bounces):
            total = self._direct.copy()
            for cells, weights, owners in links:
                add_weighted(radiance, cells, weights, owners, total)
            radiance, before = total, radiance
        self.radiance, self.radiance_before = radiance, before

    def _light(self, hits: Hits, chosen: NDArray[np.intp], *, go_on: bool) -> tuple[Hits, NDArray[np.int32]]:
        """Make the chosen hits' cells; return the hits of the rays that go on from them, and which cells they left."""
        rng = np.random.default_rng([self._seed, len(self)])
        chosen = rng.permutation(chosen)
        chosen = chosen[np.argsort(hits.keys[chosen], kind="stable")]
        keys, starts, met = np.unique(hits.keys[chosen], return_index=True, return_counts=True)
        cell = np.repeat(np.arange(len(keys)), met)
        kept = np.arange(len(chosen)) - starts[cell] < self._points
        chosen, cell = chosen[kept], cell[kept]
        share = 1 / np.minimum(met, self._points).astype(np.float32)[cell]
        first = len(self)
        self._enter(keys)

        met_points = hits.only(chosen)
        surface = self.arrive(met_points)
        weights = np.repeat(share[:, None], 3, 1).astype(np.float32)
        self._direct = np.concatenate([self._direct, self.reflected(surface, cell, weights, len(keys))])
        if not go_on:
            return hits, np.zeros(0, np.int32)
        lanes = np.repeat(np.arange(len(chosen)), BOUNCES)
        surface = self.arrive(met_points.only(lanes))
        sampler = self._mi.load_dict({"type": "independent"})
        sampler.seed(int(rng.integers(1 << 31)), len(lanes))
        onward = self.leave(surface, surface.is_valid(), sampler)
        weights = (onward.weights * (share[lanes] / BOUNCES)[:, None]).astype(np.float32)
        return replace(onward, weights=weights), (first + cell[lanes]).astype(np.int32)

    def _enter(self, keys: NDArray[np.int64]) -> None:
        first = len(self)
        self._keys = np.concatenate([self._keys, keys])
        if 3 * len(self._keys) > len(self._table):
            size = 1 << int(np.ceil(np.log2(6 * len(self._keys))))
            self._table, self._cell_of_slot = np.full(size, EMPTY), np.zeros(size, np.int32)
            keys, first = self._keys, 0
        put(self._table, self._cell_of_slot, keys, first)


@numba.njit(nogil=True, cache=True, inline="always")
def _slot(table, key):
    """Return where a key stands, or the free place where it would stand."""
    mask = len(table) - 1
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    slot = np.int64(mixed >> np.uint64(32)) & mask
    while table[slot] != key and table[slot] != EMPTY:
        slot = (slot + 1) & mask
    return slot


@numba.njit(nogil=True, cache=True)
def find(table, cell_of_slot, keys, found):
    """Fill `found` with each key's cell: -1 where unknown, -2 where the sample meets nothing."""
    for i in range(len(keys)):
        if keys[i] == NOWHERE:
            found[i] = -2
        else:
            slot = _slot(table, keys[i])
            found[i] = cell_of_slot[slot] if table[slot] == keys[i] else -1


@numba.njit(nogil=True, cache=True)
def put(table, cell_of_slot, keys, first):
    """Enter keys as the cells `first`, `first` + 1, ..."""
    for i in range(len(keys)):
        slot = _slot(table, keys[i])
        table[slot] = keys[i]
        cell_of_slot[slot] = first + i


@numba.njit(nogil=True, cache=True)
def add_weighted(radiance, cells, weights, owners, out):
    """Add weight times radiance of each sample's cell to what its owner has.

    radiance (C, 3, F).
    cells (S,): Negative: none.
    weights (S, 3); owners (S,); out (O, 3, F).
    """
    frames = radiance.shape[2]
    for i in range(len(cells)):
        if cells[i] >= 0:
            for c in range(3):
                weight, row, total = weights[i, c], radiance[cells[i], c], out[owners[i], c]
                for f in range(frames):
                    total[f] += weight * row[f]
