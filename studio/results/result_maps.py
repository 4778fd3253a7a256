"""The maps of an output folder, by method, of the photographs or the twin; what is not there says so."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from compare.report.pictures import colour_scale_end
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.reading import array_of
from studio.review.folder import Review

Side = Literal["photographs", "twin"]
SIDES: tuple[Side, ...] = get_args(Side)
MOST_PIXELS = 400_000
"""Of a map that histogram and colour scale look at."""


@dataclass(frozen=True)
class Source:
    """Whose map it is: a method's, of the photographs or of the twin; or the ground truth's."""

    method: str
    side: Side = "photographs"

    @property
    def label(self) -> str:
        return "ground truth" if self == TRUTH else f"{self.method}, {self.side}"


TRUTH = Source("truth")


@dataclass(frozen=True, eq=False)
class Results:
    """What the solvers left in an output folder; maps are read when they are first asked for."""

    review: Review
    _opened: dict[tuple[str, Source], NDArray] = field(default_factory=dict, repr=False)

    @property
    def methods(self) -> list[str]:
        return [name for name in self.review.material.methods if name != TRUTH.method]

    @property
    def sources(self) -> list[Source]:
        """All that can be chosen; that a map is not there is told when it is."""
        return [*(Source(method, side) for method in self.methods for side in SIDES), TRUTH]

    @property
    def first_pair(self) -> tuple[Source, Source]:
        """The first method's photographs and twin; without a twin, beside another method or the truth."""
        if not self.methods:
            return TRUTH, TRUTH
        left = Source(self.methods[0])
        for right in (Source(left.method, "twin"), *map(Source, self.methods[1:2])):
            if self.path("normals", right).exists():
                return left, right
        return left, TRUTH

    @cached_property
    def size(self) -> tuple[int, int]:
        """Width and height, px: those of the frames, else of the first map that is there."""
        frames = self.review.material.frames
        if frames is not None:
            return frames.width, frames.height
        for source in self.sources:
            if self.path("normals", source).exists():
                shape = self._open("normals", source).shape
                return shape[1], shape[0]
        raise SceneError("results: there are neither frames nor normals in this folder. Run the steps.")

    def path(self, place: str, source: Source) -> Path:
        """Return where a map lies, whether it is there or not."""
        return self.review.store.path(*(("twin",) if source.side == "twin" else ()), place, f"{source.method}.npy")

    def map(self, place: str, source: Source) -> NDArray:
        """Return a map (H, W) or (H, W, 3), memory-mapped; place: `normals`, `albedo`, `sigma` or `depth`.

        Raises SceneError: it is not there, cannot be read, or has another size than the frames.
        """
        found = self._open(place, source)
        width, height = self.size
        if found.shape[:2] != (height, width):
            raise SceneError(
                f"{self._named(place, source)}: {found.shape[1]} x {found.shape[0]} px, the frames are {width} x "
                f"{height} px. Run its step again."
            )
        return found

    def at(self, place: str, source: Source, u: int, v: int) -> NDArray[np.float64]:
        """Return a map's value at a pixel, () or (3,); NaN where the map is not there."""
        try:
            return np.asarray(self.map(place, source)[v, u], np.float64)
        except SceneError:
            return np.full(3 if place in ("normals", "albedo") else (), np.nan)

    def errors(self, source: Source, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the angle between normals and truth, degrees, at pixels; NaN where unknown and off the mask."""
        if self.review.truth is None:
            raise SceneError(f"no ground truth: {self.review.missing['scan']}")
        truth, normals = self.map("normals", TRUTH)[rows, columns], self.map("normals", source)[rows, columns]
        mask = self.review.material.mask
        return np.where(True if mask is None else mask[rows, columns], angular_error_deg(normals, truth), np.nan)

    @cached_property
    def some_pixels(self) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
        """Rows and columns (P,) of every n-th pixel under the mask, at most `MOST_PIXELS`, and n."""
        mask, (width, height) = self.review.material.mask, self.size
        inside = np.arange(width * height) if mask is None else np.flatnonzero(mask)
        every = -(-len(inside) // MOST_PIXELS) or 1
        rows, columns = np.divmod(inside[::every], width)
        return rows, columns, every

    @cached_property
    def known_errors(self) -> dict[Source, NDArray[np.float64]]:
        """Errors (K,) at `some_pixels` where they are known, of each source that has any."""
        rows, columns, _ = self.some_pixels
        found = {}
        for source in self.sources[:-1]:
            try:
                errors = self.errors(source, rows, columns)
            except SceneError:
                continue
            if np.isfinite(errors).any():
                found[source] = errors[np.isfinite(errors)]
        return found

    @cached_property
    def error_end_deg(self) -> float:
        """End of the one colour scale of all error maps, by the report's rule."""
        ends = [float(np.quantile(errors, 0.95)) for errors in self.known_errors.values()]
        return colour_scale_end(float(np.median(ends))) if ends else 90.0

    def frames(self, side: Side) -> tuple[Frames, Lights]:
        """Return the frames of a side, and their lights; SceneError where these are not there or do not fit."""
        part, missing = "frames" if side == "photographs" else "twin", self.review.missing
        for name in (part, "lights"):
            if name in missing:
                raise SceneError(f"no {name}: {missing[name]}")
        frames, lights = self.review.need(part, "lights")
        if frames.names != lights.names or (frames.width, frames.height) != self.size:
            raise SceneError(
                f"{part}: {len(frames)} frames of {frames.width} x {frames.height} px; {len(lights)} lights with the "
                f"same names and maps of {self.size[0]} x {self.size[1]} px were expected. Run the steps again."
            )
        return frames, lights

    def _open(self, place: str, source: Source) -> NDArray:
        if (place, source) in self._opened:
            return self._opened[place, source]
        path, named = self.path(place, source), self._named(place, source)
        if not path.exists():
            step = "align" if source == TRUTH else "solve" if source.side == "photographs" else "twin"
            raise SceneError(f"no {named} in this folder. The step `{step}` leaves them.")
        found = array_of(path, do="Run its step again.")
        if found.ndim != (3 if place in ("normals", "albedo") else 2):
            raise SceneError(f"{named}: {path.name} holds an array {found.shape}. Run its step again.")
        self._opened[place, source] = found
        return found

    @staticmethod
    def _named(place: str, source: Source) -> str:
        return f"{place} of the ground truth" if source == TRUTH else f"{place} of {source.method} ({source.side})"
