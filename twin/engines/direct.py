"""The engine `direct`: light that comes straight from the flashes, without Monte Carlo noise.

One sample a pixel for all flashes, then more of them where that picture bends: at edges, shadow borders, highlights
and texture, and there only for the flashes that need them. A sample is one camera ray, and for each flash one shadow
ray and the BRDF's closed form.
"""

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights
from twin.engines.film import Film
from twin.engines.flash_shading import WHOLE, Flashes, add_whole, by_bands, camera_rays, start_above, tiles
from twin.engines.sampling_plan import bends, plan_samples, predicted_error, samples_for, tolerance_for
from twin.engines.variant import import_mitsuba

VALUES_PER_BAND = 1 << 23
"""Of a band's images, in float32: 32 MiB, and several times as much for its second differences and plan."""
PILOT_TILES, PILOT_SIDE = 8, 16
LATTICE = 0.7548776662466927, 0.5698402909980532
"""Additive recurrence in two dimensions: every first n points are well spread [Roberts2018]."""
LANES = 1 << 21


class Direct:
    """A scene before a film under flashes.

    Parameters
    ----------
    scene : mi.Scene
        Shapes and materials, mm, camera frame. Emitters of its own are not rendered.
    lights : Lights
        Distant, or points; see `Flashes` for the units.
    error : float
        Root mean square error of the box that is asked for, over each frame's mean brightness where any light meets an
        object; a frame counts as at least a tenth as bright as the brightest.

    Attributes
    ----------
    tolerance : float
        Second difference, of a frame's brightness, that asks for about one sample; from a pilot rendering.
    samples_per_pixel : float
        Camera samples a pixel and light, mean, as the pilot predicts.
    """

    def __init__(self, scene: Any, film: Film, lights: Lights, *, error: float = 0.01) -> None:
        self._mi = import_mitsuba()
        self._scene, self._film = scene, film
        self._flashes = Flashes(self._mi, lights)
        self._above = start_above(self._mi, scene)
        self._brightness, self._bend = self._pilot()
        self._aim(error)

    def _aim(self, error: float) -> None:
        self.tolerance = tolerance_for(self._bend, error)
        samples = samples_for(self._bend, self.tolerance)
        self.predicted_error, self.samples_per_pixel = predicted_error(self._bend, samples), float(samples.mean())

    def aimed_at(self, error: float) -> "Direct":
        """Return the same scene and film at another error, by the same pilot."""
        other = copy.copy(self)
        other._aim(error)
        return other

    def images(self) -> NDArray[np.float32]:
        """Return (F, h, w, 3), linear, of the film's box."""
        step = VALUES_PER_BAND // (3 * self._film.size[1] * self._flashes.count)
        return by_bands(self._film, self._flashes.count, step, self.band)

    def band(self, rows: slice) -> NDArray[np.float32]:
        """Return (F, rows, w, 3) of some of the box's rows; the same values whatever the bands' size."""
        (height, width), start, stop = self._film.size, rows.start, rows.stop
        # One row more on either side: whether a pixel bends depends on its neighbours.
        first, last = max(start - 1, 0), min(stop + 1, height)
        images = self._once(slice(first, last), slice(0, width), np.zeros((1, 2), np.intp))[:, 0]
        bend = np.empty(images.shape[:3], np.float32)
        bends(images, self._brightness, bend)
        plan = plan_samples(bend, start - first, stop - start, self.tolerance)
        images = images[:, start - first : stop - first]
        self._refine(images, start, plan)
        return images

    def _once(self, rows: slice, columns: slice, corners: NDArray[np.intp]) -> NDArray[np.float32]:
        """Return (F, P, h, w, 3): one sample in the middle of each pixel of equal pieces of the box.

        `rows`, `columns`: the first piece; `corners` (P, 2): the pieces' places after that, rows and columns.
        """
        import drjit as dr

        mi, flashes = self._mi, self._flashes
        height, width = rows.stop - rows.start, columns.stop - columns.start
        order = tiles(height, width)
        place = (np.arange(len(corners))[:, None] * (height * width) + order).ravel()
        row = (corners[:, :1] + rows.start + order // width).ravel()
        column = (corners[:, 1:] + columns.start + order % width).ravel()
        surface, bsdf, seen = self._seen(mi.Float(column.astype(np.float32)), mi.Float(row.astype(np.float32)))
        slot = mi.UInt32(place.astype(np.uint32))
        out = dr.zeros(mi.Float, 3 * flashes.count * len(place))

        def add(light: Any, active: Any) -> None:
            value = flashes.reflected(self._scene, surface, bsdf, light, active, coherent=True)
            dr.scatter(out, value, light * len(place) + slot, active)

        flashes.loop(flashes.count, seen, add)
        return out.numpy().reshape(flashes.count, len(corners), height, width, 3)

    def _seen(self, x: Any, y: Any) -> tuple[Any, Any, Any]:
        """Return surface, material and whether there is one, at positions in the box."""
        ray = camera_rays(self._mi, self._film, x, y, self._above)
        surface = self._scene.ray_intersect(ray, self._mi.RayFlags.All, True, True)
        return surface, surface.bsdf(), surface.is_valid()

    def _refine(self, images: NDArray[np.float32], first_row: int, plan: tuple) -> None:
        """Put the mean of the planned samples into images (F, rows, w, 3), in place."""
        pixels, first_lane, first_pair, light, samples, lights_of_lane = plan
        width = images.shape[2]
        total = np.zeros((len(light), 3), np.float32)
        start = 0
        while start < len(pixels):
            stop = max(start + 1, int(np.searchsorted(first_lane, first_lane[start] + LANES, "right")) - 1)
            lanes, pairs = slice(first_lane[start], first_lane[stop]), slice(first_pair[start], first_pair[stop])
            owner = np.repeat(np.arange(start, stop), np.diff(first_lane[start : stop + 1]))
            sample = np.arange(lanes.start, lanes.stop) - first_lane[owner]
            total[pairs] = self._samples(
                pixels[owner] + first_row * width,
                sample,
                first_pair[owner] - first_pair[start],
                lights_of_lane[lanes],
                light[pairs],
            )
            start = stop
        owner = np.repeat(pixels, np.diff(first_pair))
        images[light, owner // width, owner % width] = total / samples[:, None]

    def _samples(self, pixel, sample, first_pair, turns, light) -> NDArray[np.float32]:
        """Return (pairs, 3), the sum over the lanes that belong to each pair of pixel and light."""
        import drjit as dr

        mi, flashes, width = self._mi, self._flashes, self._film.size[1]
        place, number, first, count = (mi.UInt32(a.astype(np.uint32)) for a in (pixel, sample, first_pair, turns))
        light_of_pair = mi.UInt32(light.astype(np.uint32))
        shift = mi.sample_tea_32(place, mi.UInt32(1))
        x, y = (mi.Float(number // 2) * LATTICE[axis] + mi.Float(shift[axis]) * 2.0**-32 for axis in (0, 1))
        # Each point and its mirror image about the pixel's middle: what is linear across the pixel has no error.
        side = dr.select(number % 2 == 0, 1.0, -1.0)
        x, y = side * (x - dr.floor(x) - 0.5), side * (y - dr.floor(y) - 0.5)
        surface, bsdf, seen = self._seen(mi.Float(place % width) + x, mi.Float(place // width) + y)
        out, scale = dr.zeros(mi.UInt64, 3 * len(light)), mi.Float(WHOLE / self._brightness)

        def add(turn: Any, active: Any) -> None:
            index = dr.gather(mi.UInt32, light_of_pair, first + turn, active)
            value = flashes.reflected(self._scene, surface, bsdf, index, active, coherent=True)
            value *= dr.gather(mi.Float, scale, index, active)
            add_whole(mi, out, lambda channel: 3 * (first + turn) + channel, value, active)

        flashes.loop(count, seen, add)
        return (out.numpy().reshape(-1, 3) / (WHOLE / self._brightness[light])[:, None]).astype(np.float32)

    def _pilot(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the frames' brightness (F,), and second differences (F, tiles, pixels) of tiles all over the film."""
        height, width = self._film.size
        side = min(PILOT_SIDE, height, width)
        tops = np.unique(np.linspace(0, height - side, PILOT_TILES).astype(int))
        lefts = np.unique(np.linspace(0, width - side, PILOT_TILES).astype(int))
        corners = np.stack(np.meshgrid(tops, lefts, indexing="ij"), -1).reshape(-1, 2)
        images = self._once(slice(0, side), slice(0, side), corners)
        seen = np.count_nonzero(images.max((0, -1)) > 0)
        means = images.mean(-1).sum((1, 2, 3)) / max(seen, 1)
        # A frame that is nearly black need not be exact to a per cent of that.
        brightness = np.maximum(means, 0.1 * means.max() if seen else 1).astype(np.float32)
        bend = np.empty(images.shape[:4], np.float32)
        every = images.reshape(-1, side, side, 3), np.repeat(brightness, len(corners))
        bends(*every, bend.reshape(-1, side, side))
        return brightness, bend
