"""From the frames to what the solvers see: the pixels of a band as the kernels read them, and where the light is."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scene.frames import PEDESTAL, WHITE, Frames, decode
from scene.lights import Lights
from solve.codes import read_gray
from solve.problem import Problem

GRAY = np.array([0.2989, 0.5870, 0.1140])
"""Rec. 601 weights, as the published DiLiGenT figures use them [Shi2019]."""

_BAND_BYTES = 64 << 20


class Band(NamedTuple):
    """The masked pixels of one row band, where they lie in the store, as kernels read them.

    Parameters
    ----------
    codes : (F h w 3,) uint16 or float32
        All of the store, or a copy of the band, flat; never a float copy of uint16.
    shape : (F, h, w)
        Of `codes`.
    ambient : (h w 3,) float32
        Linear; empty where there is none.
    black : float32
    unit : (F,) float32
        linear = (code - black) * unit - ambient.
    limit : as codes
        The code from which a sample is clipped, and
    margin : int
        how many pixels around it are then not believed either.
    runs : (R, 4) int64
        Stretches of masked pixels in `codes`: row, column, how many, and the number of the first among the P.
    """

    codes: NDArray
    shape: tuple[int, int, int]
    ambient: NDArray[np.float32]
    black: np.float32
    unit: NDArray[np.float32]
    limit: np.generic
    margin: int
    runs: NDArray[np.int64]


class Geometry(NamedTuple):
    """Where the light comes from, as kernels read it; see `Lights.toward`.

    Parameters
    ----------
    directions, positions : (F, 3) float64
    reach : (F,) float64
        Squared distance from each light to the reference point.
    is_near : bool
    """

    directions: NDArray[np.float64]
    positions: NDArray[np.float64]
    reach: NDArray[np.float64]
    is_near: bool

    @classmethod
    def of(cls, lights: Lights) -> "Geometry":
        """Return the geometry of calibrated lights."""
        if lights.positions_mm is None:
            return cls.distant(lights.directions)
        positions = np.ascontiguousarray(lights.positions_mm)
        reach = np.sum((positions - lights.reference_point_mm) ** 2, 1)
        return cls(np.ascontiguousarray(lights.directions), positions, reach, True)

    @classmethod
    def distant(cls, vectors: NDArray[np.float64]) -> "Geometry":
        """Return the geometry of distant lights (F, 3)."""
        vectors = np.ascontiguousarray(vectors)
        return cls(vectors, np.zeros_like(vectors), np.zeros(len(vectors)), False)


class Samples(NamedTuple):
    """What is seen of some pixels, as kernels read it.

    Parameters
    ----------
    gray : (P, F) float32
        Divided by the lights' intensities.
    valid : (P, F) bool
        Not clipped.
    points : (P, 3) float64
        Where the pixels are, mm, for near lights.
    lights : Geometry
    """

    gray: NDArray[np.float32]
    valid: NDArray[np.bool_]
    points: NDArray[np.float64]
    lights: Geometry

    def some(self, chosen: NDArray | slice) -> "Samples":
        """Return those of some of the pixels."""
        return Samples(self.gray[chosen], self.valid[chosen], self.points[chosen], self.lights)

    def scale(self) -> float:
        """Return the 99th percentile of what is not clipped, from at most some 5,000 pixels."""
        step = max(1, len(self.gray) // 5_000)
        values = self.gray[::step][self.valid[::step]]
        scale = float(np.percentile(values, 99)) if len(values) else 0.0
        return scale if scale > 0 else 1.0

    def toward(self) -> NDArray[np.float64]:
        """Return the light vectors (P, F, 3)."""
        directions, positions, reach, is_near = self.lights
        if not is_near:
            return np.broadcast_to(directions, (len(self.points), *directions.shape))
        arm = positions - self.points[:, None]
        return arm * (reach / np.linalg.norm(arm, axis=-1) ** 3)[..., None]


def samples_of(band: Band, part: Problem) -> Samples:
    """Return what is seen of the pixels of a problem's rows; `band` holds them."""
    gray, valid = read_gray(band, (GRAY / part.lights.intensities).astype(np.float32))
    return Samples(gray, valid, part.points(), Geometry.of(part.lights))


def all_samples(problem: Problem) -> Samples:
    """Return what is seen of all pixels of the mask, read band by band."""
    shape = int(problem.mask.sum()), len(problem.frames)
    gray, valid, done = np.empty(shape, np.float32), np.empty(shape, bool), 0
    for rows in bands(problem.frames, problem.mask):
        part = problem.part(rows)
        some = samples_of(read_band(part), part)
        gray[done : done + len(some.gray)], valid[done : done + len(some.gray)] = some.gray, some.valid
        done += len(some.gray)
    return Samples(gray, valid, problem.points(), Geometry.of(problem.lights))


def bands(frames: Frames, mask: NDArray[np.bool_]) -> Iterator[slice]:
    """Yield the row slices that hold pixels of the mask, each small enough for the cache of a worker."""
    yield from (band for band in frames.bands(_BAND_BYTES) if mask[band].any())


def read_band(part: Problem) -> Band:
    """Return where the pixels of a problem's rows lie in the store, in the order of the mask."""
    frames, rows = part.frames, part.rows
    margin = 1 if frames.is_mosaic else 0
    first, last = max(rows.start - margin, 0), min(rows.stop + margin, frames.height)
    codes, shift = frames.codes, 0
    if codes.dtype != np.uint16 or not codes.flags.c_contiguous:
        codes, shift = codes[:, first:last], first
    if codes.dtype == np.uint16:
        codes, black, unit = np.ascontiguousarray(codes), np.float32(PEDESTAL), np.float32(1 / (WHITE - PEDESTAL))
    else:
        codes, black, unit = np.ascontiguousarray(codes, np.float32), np.float32(0), np.float32(1)
    ambient = np.zeros(0, np.float32)
    if frames.ambient is not None:
        # As tall as the codes, so that one row number serves both; only the band's rows are touched.
        whole = np.zeros(codes.shape[1:], np.float32)
        whole[rows.start - shift : rows.stop - shift] = decode(frames.ambient[rows])
        ambient = whole.reshape(-1)
    flat = np.asarray(codes).reshape(-1)
    # Memory maps are read-only; that all are spares compiling everything twice.
    flat.flags.writeable = False
    return Band(
        flat,
        codes.shape[:3],
        ambient,
        black,
        unit * frames.gain.astype(np.float32),
        codes.dtype.type(frames.limit),
        margin,
        _runs(part.mask, rows.start - shift),
    )


def _runs(mask: NDArray[np.bool_], first_row: int) -> NDArray[np.int64]:
    """Return the stretches of the mask (h, W) as in `Band`, its first row being `first_row` of the codes."""
    height, width = mask.shape
    # A column of False behind each row ends a run there.
    padded = np.zeros((height, width + 1), np.int8)
    padded[:, :-1] = mask
    steps = np.diff(padded.reshape(-1), prepend=np.int8(0))
    starts, stops = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)
    count = stops - starts
    row, column = np.divmod(starts, width + 1)
    return np.stack([row + first_row, column, count, np.cumsum(count) - count], -1).astype(np.int64)


def scale_of(problem: Problem) -> float:
    """Return the 99th percentile of the lit gray samples, from at most some 20,000 pixels under the mask.

    Every threshold of the solvers is relative to it, so that exposure changes nothing.
    """
    rows = np.flatnonzero(problem.mask.any(1))
    step = max(1, int(problem.mask.sum() // 20_000))
    weights = (GRAY / problem.lights.intensities).astype(np.float32)
    parts = (problem.part(slice(row, row + 1)) for row in rows[:: max(1, min(step, len(rows) // 16))].tolist())
    values = [read_gray(read_band(part), weights)[0].ravel() for part in parts]
    return float(np.percentile(np.concatenate(values), 99, overwrite_input=True))


def row_medians(values: NDArray, where: NDArray[np.bool_]) -> NDArray:
    """Return the lower median of each row (N, M) over the entries of `where`; 0 where there are none.

    By one sort of all rows: numpy's own median with gaps calls Python for each.
    """
    ordered = np.sort(np.where(where, values, np.inf), axis=1)
    count = where.sum(1)
    middle = np.take_along_axis(ordered, np.maximum(count - 1, 0)[:, None] // 2, 1)[:, 0]
    return np.where(count > 0, middle, 0)
