"""The engine `mitsuba`: stock Mitsuba, one path-traced image for each light. The reference of the other engines."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.description.description import TwinScene
from twin.engines.film import Film, sensor_description
from twin.engines.mitsuba_scene import flash, loadable, mitsuba_scene
from twin.engines.variant import SLOW, import_mitsuba, load

SAMPLES_PER_BAND = 1 << 21
"""Samples traced in one call: bounds the vectorised variant's memory to about half a gigabyte."""


class PathTracer:
    """A scene before a film, ready to be rendered under one light after the other."""

    def __init__(self, scene: TwinScene, film: Film) -> None:
        self._mitsuba: Any = import_mitsuba(slow=True)
        self._film, self._scene, self._lit_by = film, scene, 0
        self._loaded: Any = mitsuba_scene(scene, light=0)
        self._parameters: Any = self._mitsuba.traverse(self._loaded)

    def image(
        self, index: int, samples_per_pixel: int, *, seed: int = 0, film: Film | None = None
    ) -> NDArray[np.float32]:
        """Return pixel values (h, w, 3) of the film's window under one light and the environment.

        index: Which light.
        seed: Other samples of the same light.
        film: Another window of the same camera.
        """
        if index != self._lit_by:
            self._light(index)
        return traced(self._loaded, film or self._film, self._scene.points, samples_per_pixel, (seed, index))

    def _light(self, index: int) -> None:
        """Change the flash in place: shapes and materials, which cost the time, stay."""
        mi, new, was = self._mitsuba, flash(self._scene, index), flash(self._scene, self._lit_by)
        self._lit_by = index
        if new["type"] != was["type"]:
            self._loaded = mitsuba_scene(self._scene, light=index)
            self._parameters = mi.traverse(self._loaded)
            return
        wanted = mi.traverse(load(loadable(mi, new)))
        for key in wanted.keys():  # noqa: SIM118 (no mapping)
            self._parameters[f"flash.{key}"] = wanted[key]
        self._parameters.update()


def traced(loaded: Any, film: Film, points: NDArray, samples: int, seeds: tuple[int, ...]) -> NDArray[np.float32]:
    """Return pixel values (h, w, 3) of a film's window by stock Mitsuba.

    loaded: A `mi.Scene` with its light.
    points (P, 3): What the scene lies between, mm.
    samples: A pixel.
    """
    import mitsuba as mi

    bands = []
    for first_row, height in film.bands(SAMPLES_PER_BAND, samples):
        sensor = load(sensor_description(film, points, first_row, height))
        # Mixed, not added up: neighbouring bands and lights must not share samples.
        seed: Any = int(np.random.SeedSequence([*seeds, first_row]).generate_state(1)[0])
        if mi.variant() == SLOW:
            band = np.asarray(mi.render(loaded, sensor=sensor, spp=samples, seed=seed), np.float32)[..., :3]
        else:
            band = _in_order(loaded, sensor, samples, seed).reshape(height, -1, 3)
        bands.append(band)
    return np.concatenate(bands)


def _in_order(loaded: Any, sensor: Any, samples: int, seed: int) -> NDArray[np.float32]:
    """Return pixel values (P, 3) as `mi.render` has them, each pixel's samples added by one thread, in their order.

    Stock's film adds from several threads, in the order in which they come: no two renderings are the same.
    """
    import drjit as dr
    import mitsuba as mi

    size = sensor.film().crop_size()
    count = int(size[0]) * int(size[1])
    sampler = sensor.sampler().clone()
    sampler.set_sample_count(samples)
    sampler.set_samples_per_wavefront(samples)
    # Opaque: a number would be compiled into the kernel, anew for each seed.
    sampler.seed(dr.opaque(mi.UInt32, seed), count * samples)
    pixel = dr.arange(mi.UInt32, count * samples) // samples
    place = mi.Vector2f(mi.Float(pixel % size[0]), mi.Float(pixel // size[0])) + sampler.next_2d()
    ray, weight = sensor.sample_ray_differential(0, 0, place / mi.ScalarVector2f(size), mi.Point2f(0.5))
    found, _, _ = loaded.integrator().sample(loaded, sampler, ray)
    value = found * weight
    # Each sum by itself would trace all paths again.
    dr.eval(value)
    return np.stack([np.asarray(dr.block_sum(part, samples), np.float32) for part in value], -1) / np.float32(samples)
