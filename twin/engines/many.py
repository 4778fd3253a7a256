"""The engine `many`: stock Mitsuba's paths, each traced once for all the flashes of the stack.

A path costs its rays, a flash one more from each surface on the way: the path is shared, and so is the scene.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights
from twin.description.description import white_of
from twin.engines.film import Film
from twin.engines.variant import import_mitsuba

LATTICE = 0.7548776662466927, 0.5698402909980532
"""Additive recurrence in two dimensions: every first n points are well spread [Roberts2018]."""
UNIT = 2.0**-32
"""Of a random whole number of 32 bits, over the numbers below 1."""


class Many:
    """A scene before a film under flashes.

    Parameters
    ----------
    scene : mi.Scene
        Shapes and materials, mm, camera frame. Emitters of its own are not rendered.
    lights : Lights
        Distant, or points. Pixel values are those of `TwinScene`: a flash of intensity 1 gives the irradiance pi (times
        white_value / 0.8 where that is given) on what faces it at the lights' reference point.
    max_depth : int
        2: light meets one surface; 3: two; and so on.
    """

    def __init__(self, scene: Any, film: Film, lights: Lights, *, max_depth: int) -> None:
        self._mi = mi = import_mitsuba()
        self._scene, self._film, self._count, self._depth = scene, film, len(lights), max_depth
        low, high = np.array(scene.bbox().min).ravel(), np.array(scene.bbox().max).ravel()
        # Above all of the scene: orthographic rays start there.
        self._above = float(high[2] + 1 + 0.1 * np.max(high - low))
        power, places = np.pi * lights.intensities * white_of(lights), lights.directions
        self._near = lights.positions_mm is not None
        if lights.positions_mm is not None:
            places = lights.positions_mm
            power = power * np.sum((places - lights.reference_point_mm) ** 2, 1, keepdims=True)
        self._places, self._power = (mi.Float(a.astype(np.float32).ravel()) for a in (places, power))

    def band(self, rows: slice, samples: int, seed: int = 0) -> NDArray[np.float32]:
        """Return (2, F, rows, w, 3) of some of the box's rows: light of one surface, of more; linear.

        samples: Paths a pixel.
        seed: Other paths.

        The same values whatever the bands: a pixel's samples are its own, and one thread adds them, in their order.
        """
        import drjit as dr

        mi, (height, width) = self._mi, (rows.stop - rows.start, self._film.size[1])
        size, lanes = height * width, dr.arange(mi.UInt32, height * width)
        middle, right, down = (
            mi.Vector3f(np.ascontiguousarray(a.reshape(-1, 3).T, np.float32)) for a in self._views(rows)
        )
        own = mi.sample_tea_32(lanes + dr.opaque(mi.UInt32, rows.start * width), dr.opaque(mi.UInt32, seed))
        others = mi.sample_tea_32(own[0], own[1])
        # Opaque: numbers would be compiled into the kernel, anew for each band.
        step, count, most, depth = (dr.opaque(mi.UInt32, n) for n in (size, self._count, samples, self._depth))
        out = dr.zeros(mi.Float, 6 * self._count * size)

        def lit(surface: Any, weight: Any, layer: Any, active: Any) -> None:
            def add(light: Any) -> tuple[Any]:
                value = weight * self._reflected(surface, light, active)
                for channel in range(3):
                    place = ((layer * count + light) * 3 + channel) * step + lanes
                    dr.scatter_add(out, value[channel], place, active, dr.ReduceMode.NoConflicts)
                return (light + 1,)

            dr.while_loop((mi.UInt32(0),), lambda light: active & (light < count), add)

        def path(sample: Any) -> tuple[Any]:
            # A point of the pixel and its mirror image about the middle: what is linear across it has no error.
            across, along = _spread(mi, own, sample // 2)
            across, along = (dr.select(sample % 2 == 0, x - 0.5, 0.5 - x) for x in (across, along))
            toward = middle + across * right + along * down
            flat = self._film.camera.is_orthographic
            origin = mi.Point3f(toward.x, toward.y, self._above) if flat else mi.Point3f(0)
            toward = mi.Vector3f(0, 0, -1) if flat else dr.normalize(toward)
            first: Any = _spread(mi, others, sample)

            def bounce(turn: Any, origin: Any, toward: Any, weight: Any, active: Any) -> tuple[Any, ...]:
                ray = mi.Ray3f(origin, toward)
                surface = self._scene.ray_intersect(ray, mi.RayFlags.All, False, active)
                active &= surface.is_valid()
                lit(surface, weight, dr.minimum(turn, 1), active)
                active &= turn + 2 < depth
                key = mi.sample_tea_32(own[1], sample * 256 + 2 * turn)
                lobe, (x, y) = key[0] * UNIT, mi.sample_tea_32(key[1], sample * 256 + 2 * turn + 1)
                place = mi.Point2f(dr.select(turn == 0, first[0], x * UNIT), dr.select(turn == 0, first[1], y * UNIT))
                drawn, share = surface.bsdf().sample(mi.BSDFContext(), surface, lobe, place, active)
                onward = surface.spawn_ray(surface.to_world(drawn.wo))
                weight = weight * share
                return turn + 1, onward.o, onward.d, weight, active & (dr.max(weight) > 0)

            start = mi.UInt32(0), origin, toward, mi.Color3f(1), mi.Bool(True)
            dr.while_loop(start, lambda turn, origin, toward, weight, active: active, bounce)
            return (sample + 1,)

        dr.while_loop((dr.zeros(mi.UInt32, size),), lambda sample: sample < most, path)
        found = out.numpy().reshape(2, self._count, 3, height, width)
        return np.divide(np.moveaxis(found, 2, -1), samples, dtype=np.float32, order="C")

    def _views(self, rows: slice) -> tuple[NDArray, ...]:
        """Return the middle of each pixel, and its sides right and down (h, w, 3), where its rays go through.

        Perspective: on the plane z = -1; else on z = 0. Between its corners a pixel is straight.
        """
        camera, top, left = self._film.camera, self._film.rows.start, self._film.columns.start
        v, u = np.mgrid[top + rows.start : top + rows.stop + 1, left : self._film.columns.stop + 1] - 0.5
        origins, directions = camera.rays(np.stack([u, v], -1))
        corners = origins if camera.is_orthographic else directions / -directions[..., 2:]
        beside, below = (corners[:, 1:] - corners[:, :-1]), (corners[1:] - corners[:-1])
        middle = (corners[1:, 1:] + corners[1:, :-1] + corners[:-1, 1:] + corners[:-1, :-1]) / 4
        return middle, (beside[1:] + beside[:-1]) / 2, (below[:, 1:] + below[:, :-1]) / 2

    def _reflected(self, surface: Any, index: Any, active: Any) -> Any:
        """Return the radiance that flash `index` sends by way of a surface toward where its ray came from.

        E f(wi, wo) cos, black where the flash is behind the surface (no ray is traced) or hidden.
        """
        import drjit as dr

        mi = self._mi
        place = dr.gather(mi.Vector3f, self._places, index, active)
        power = dr.gather(mi.Color3f, self._power, index, active)
        if self._near:
            offset = place - surface.p
            square = dr.squared_norm(offset)
            toward, power = offset * dr.rsqrt(square), power / square
            ray = surface.spawn_ray_to(mi.Point3f(place))
        else:
            toward, ray = place, surface.spawn_ray(place)
        value = surface.bsdf().eval(mi.BSDFContext(), surface, surface.to_local(toward), active) * power
        seen = active & (dr.max(value) > 0)
        seen &= ~self._scene.ray_test(ray, True, seen)
        return dr.select(seen, value, 0)


def _spread(mi: Any, shifts: Any, number: Any) -> list[Any]:
    """Return two numbers 0 to 1: the lattice's point of that number, moved by two random whole numbers."""
    import drjit as dr

    moved = [mi.Float(shift) * UNIT + mi.Float(number) * step for shift, step in zip(shifts, LATTICE, strict=True)]
    return [x - dr.floor(x) for x in moved]
