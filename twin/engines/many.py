"""The engine `many`: one trip through the scene for all flashes of the stack.

Direct light by the engine `direct`. Light that has met more than one surface: camera rays are sent on from the first
surface and end in cells that know what they send back under every flash (twin/engines/radiance_cells.py).
"""

import os
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights
from twin.engines.film import Film
from twin.engines.flash_shading import Flashes, by_bands, camera_rays, start_above
from twin.engines.radiance_cells import NOWHERE, Hits, RadianceCells, add_weighted
from twin.engines.variant import import_mitsuba

SAMPLES_PER_CALL = 1 << 21
FIRST_LOOK = 1 << 19
"""Paths all over the film that find the cells, before any picture is made in bands."""


class Indirect:
    """Light that meets two surfaces or more on its way from a flash to the camera.

    scene, film, lights: As in `Direct`.
    samples: Paths a pixel; rounded to what a jittered grid can hold.
    max_depth: 3: light meets two surfaces; 4: three; and so on.
    """

    def __init__(
        self, scene: Any, film: Film, lights: Lights, *, samples: int = 16, max_depth: int = 5, seed: int = 0
    ) -> None:
        self._mi = import_mitsuba()
        self._scene, self._film, self._seed = scene, film, seed
        self._count, self.samples = len(lights), self._sampler(samples).sample_count()
        self._above, self._bounces = start_above(self._mi, scene), max_depth - 3
        self._pool = ThreadPoolExecutor(os.cpu_count() or 1)
        flashes, how = Flashes(self._mi, lights), {"bounces": self._bounces, "paths": self.samples, "seed": seed}
        self._empty = RadianceCells(self._mi, scene, flashes, **how)

    def images(self) -> NDArray[np.float32]:
        """Return (F, h, w, 3), linear, of the film's box."""
        # A pixel costs memory for its samples, and for its lights.
        step = SAMPLES_PER_CALL // (self._film.size[1] * max(self.samples, self._count // 4))
        return by_bands(self._film, self._count, step, self.band)

    def band(self, rows: slice) -> NDArray[np.float32]:
        """Return (F, rows, w, 3) of some of the box's rows; the same whatever bands were rendered before."""
        start, height, width = rows.start, rows.stop - rows.start, self._film.size[1]
        # What a band has learned is forgotten: the next must not depend on it.
        self._cells = (self._empty if height == self._film.size[0] else self._known).copy()
        row, column = np.mgrid[start : start + height, 0:width].reshape(2, -1)
        hits = self._paths(row, column, self.samples, start + 1)
        owners = np.repeat(np.arange(len(row), dtype=np.int32), self.samples)
        glossy = np.nonzero(hits.glossy)[0]
        hits.keys[glossy] = NOWHERE
        cells = self._cells.cells(hits, self._pool)
        out = np.zeros((len(row), 3, self._count), np.float32)
        if len(glossy):
            out += self._by_way_of(hits.only(glossy), owners[glossy], len(row), start)

        def add(piece: slice) -> None:
            samples = slice(piece.start * self.samples, piece.stop * self.samples)
            own = owners[samples]
            add_weighted(self._cells.radiance, cells[samples], hits.weights[samples], own, out)

        step = 4096
        list(self._pool.map(add, [slice(i, min(i + step, len(row))) for i in range(0, len(row), step)]))
        out /= self.samples
        return np.ascontiguousarray(out.reshape(height, width, 3, -1).transpose(3, 0, 1, 2))

    @cached_property
    def _known(self) -> RadianceCells:
        """The cells that all bands start from, so that they fit together; one that is all of the film needs none."""
        height, width = self._film.size
        step = max(1, int(np.sqrt(height * width / FIRST_LOOK)))
        rows, columns = np.mgrid[0:height:step, 0:width:step].reshape(2, -1)
        cells = self._empty.copy()
        cells.cells(self._paths(rows, columns, max(1, FIRST_LOOK // len(rows)), 0), self._pool)
        return cells

    def _by_way_of(self, hits: Hits, owners: NDArray[np.int32], count: int, number: int) -> NDArray[np.float32]:
        """Return (count, 3, F): what glossy surfaces send on to their owners, each path for itself.

        What such a surface sends on depends on where it is seen from, so the path goes on and ends in the next cell.
        """
        surface = self._cells.arrive(hits)
        out = self._cells.reflected(surface, owners, hits.weights, count)
        if self._bounces > 0:
            sampler = self._mi.load_dict({"type": "independent"})
            sampler.seed(int(np.random.SeedSequence([self._seed, 1, number]).generate_state(1)[0]), len(owners))
            onward = self._cells.leave(surface, surface.is_valid(), sampler)
            cells = self._cells.cells(onward, self._pool)
            add_weighted(self._cells.radiance_before, cells, onward.weights * hits.weights, owners, out)
        return out

    def _sampler(self, samples: int) -> Any:
        # What a jittered grid cannot hold is rounded up here, without Mitsuba's line on the terminal.
        rows = int(np.sqrt(samples))
        return self._mi.load_dict({"type": "multijitter", "sample_count": rows * -(-samples // rows)})

    def _paths(self, rows: NDArray[np.intp], columns: NDArray[np.intp], samples: int, number: int) -> Hits:
        """Return where `samples` rays from what each pixel sees end."""
        import drjit as dr

        mi = self._mi
        sampler = self._sampler(samples)
        samples = sampler.sample_count()
        sampler.set_samples_per_wavefront(samples)
        # Mixed, not added up: neighbouring bands must not share samples.
        seed = int(np.random.SeedSequence([self._seed, number]).generate_state(1)[0])
        sampler.seed(seed, len(rows) * samples)
        pixel = dr.arange(mi.UInt32, len(rows) * samples) // samples
        within = sampler.next_2d()
        x = dr.gather(mi.Float, mi.Float(columns.astype(np.float32)), pixel) + within.x - 0.5
        y = dr.gather(mi.Float, mi.Float(rows.astype(np.float32)), pixel) + within.y - 0.5
        ray = camera_rays(mi, self._film, x, y, self._above)
        surface = self._scene.ray_intersect(ray, mi.RayFlags.All, True, True)
        return self._empty.leave(surface, surface.is_valid(), sampler)
