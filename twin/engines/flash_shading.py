"""Camera rays, and all the flashes at once on what they meet: what the engines `direct` and `many` share.

A kernel traces one camera ray a lane and loops over the flashes inside: one launch for all frames.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights
from twin.description.description import white_of
from twin.engines.film import Film

WHOLE, LARGEST = 2.0**28, 2.0**50
"""Parts of a frame's brightness, or of a flash's irradiance, that light is counted in where it is added up, and the
most: 4096 of them stay within 64 bits."""


def give_memory_back() -> None:
    """Return to the system what Dr.Jit keeps of freed arrays: it would keep the most that it ever needed."""
    import drjit

    drjit.flush_malloc_cache()


class Flashes:
    """Flashes as Mitsuba arrays.

    Pixel values are those of `TwinScene`: a flash of intensity 1 gives the irradiance pi (times white_value / 0.8 where
    that is given) on what faces it at the lights' reference point. Near flashes are points.
    """

    def __init__(self, mi: Any, lights: Lights) -> None:
        self._mi = mi
        self.count = len(lights)
        power = np.pi * lights.intensities * white_of(lights)
        self._near = lights.positions_mm is not None
        strength = power.mean(1)
        self.parts = (WHOLE / np.where(strength > 0, strength, 1)).astype(np.float32)
        """(F,) whole numbers to a radiance of 1; see `add_whole`."""
        places = lights.directions
        if lights.positions_mm is not None:
            places = lights.positions_mm
            power = power * np.sum((places - lights.reference_point_mm) ** 2, 1, keepdims=True)
        self._places = mi.Float(np.ascontiguousarray(places, np.float32).ravel())
        self._power = mi.Float(np.ascontiguousarray(power, np.float32).ravel())

    def reflected(self, scene: Any, surface: Any, bsdf: Any, index: Any, active: Any, *, coherent: bool) -> Any:
        """Return the radiance that flash `index` sends by way of `surface` toward where its ray came from.

        coherent: Whether neighbouring lanes' shadow rays run side by side.

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
        value = bsdf.eval(mi.BSDFContext(), surface, surface.to_local(toward), active) * power
        lit = active & (dr.max(value) > 0)
        lit &= ~scene.ray_test(ray, coherent, lit)
        return dr.select(lit, value, 0)

    def loop(self, turns: Any, active: Any, add: Callable[[Any, Any], None]) -> None:
        """Call `add(turn, active)` for turn 0 to `turns` - 1 of each lane, in one kernel."""
        import drjit as dr

        def body(turn: Any) -> tuple[Any]:
            add(turn, active)
            return (turn + 1,)

        dr.while_loop((self._mi.UInt32(0),), lambda turn: active & (turn < turns), body, labels=("turn",))


def add_whole(mi: Any, out: Any, places: Callable[[int], Any], value: Any, active: Any) -> None:
    """Add colours as whole numbers at the places of their channels: threads add in any order, the sum is the same."""
    import drjit as dr

    for channel in range(3):
        dr.scatter_add(out, mi.UInt64(dr.minimum(value[channel], LARGEST)), places(channel), active)


def camera_rays(mi: Any, film: Film, x: Any, y: Any, above_mm: float) -> Any:
    """Return the rays of positions in the film's box, as `Camera.rays` gives them, by way of the lens.

    x, y: Columns and rows of the box, integers are pixel centres.
    above_mm: Orthographic: the z that the rays start from.
    """
    import drjit as dr

    camera = film.rendered
    if film.pixels is None:
        x, y = x + film.columns.start, y + film.rows.start
    else:
        x, y = _through_the_lens(mi, film.pixels, x, y)
    across, up = (x - camera.cx) / camera.fx, (camera.cy - y) / camera.fx
    if camera.is_orthographic:
        return mi.Ray3f(mi.Point3f(across, up, above_mm), mi.Vector3f(0, 0, -1))
    return mi.Ray3f(mi.Point3f(0, 0, 0), dr.normalize(mi.Vector3f(across, up, -1)))


def _through_the_lens(mi: Any, pixels: NDArray[np.float32], x: Any, y: Any) -> tuple[Any, Any]:
    """Return where the undistorted picture has what is seen at x, y: linear between pixel centres, and beyond."""
    import drjit as dr

    height, width = pixels.shape[:2]
    column, row = (mi.UInt32(dr.clip(dr.floor(at), 0, max(size - 2, 0))) for at, size in ((x, width), (y, height)))
    right, down = (dr.minimum(at + 1, size - 1) for at, size in ((column, width), (row, height)))
    table = mi.Float(pixels.ravel())

    def place(row: Any, column: Any) -> Any:
        return dr.gather(mi.Point2f, table, row * width + column)

    along, below = x - mi.Float(column), y - mi.Float(row)
    above = dr.lerp(place(row, column), place(row, right), along)
    found = dr.lerp(above, dr.lerp(place(down, column), place(down, right), along), below)
    return found.x, found.y


def by_bands(film: Film, count: int, step: int, band: Callable[[slice], NDArray[np.float32]]) -> NDArray[np.float32]:
    """Return (F, h, w, 3) of the film's box, rendered `step` rows at a time, at least one."""
    out = np.empty((count, *film.size, 3), np.float32)
    for start in range(0, film.size[0], max(1, step)):
        rows = slice(start, min(start + max(1, step), film.size[0]))
        out[:, rows] = band(rows)
    return out


def start_above(mi: Any, scene: Any) -> float:
    """Return a z, mm, above all of the scene."""
    low, high = np.array(scene.bbox().min).ravel(), np.array(scene.bbox().max).ravel()
    return float(high[2] + 1 + 0.1 * np.max(high - low))


def tiles(rows: int, columns: int, side: int = 4) -> NDArray[np.intp]:
    """Return the indices of a picture's pixels, tile by tile: rays that are traced together run side by side."""
    row, column = np.divmod(np.arange(rows * columns), columns)
    return np.lexsort((column % side, row % side, column // side, row // side))
