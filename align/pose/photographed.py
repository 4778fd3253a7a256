"""What a scan is registered to: the photographs of an object, and what is known of them before."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from align.pose.scan_view import signed_distance
from scene.camera import Camera
from scene.errors import AlignError
from scene.frames import Frames
from scene.lights import Lights
from scene.spheres import Sphere

ACROSS = 500
"""Pixels across the object: by no more a scan's first poses are found, and for no fewer normals are solved."""
FEWEST = 4
"""A pixel needs this many lit samples: three fit any normal without residual."""


@dataclass(frozen=True)
class Photographs:
    """The photographs of one object."""

    camera: Camera
    frames: Frames
    lights: Lights
    """One a frame; near lights are taken at each point."""
    mask: NDArray[np.bool_]
    """(H, W): the object."""
    spheres: tuple[Sphere, ...] = ()
    """The calibration balls."""

    @cached_property
    def distance(self) -> NDArray[np.float32]:
        """(H, W), to the mask's border; see `signed_distance`."""
        return signed_distance(self.mask)

    def check(self, normals: NDArray | None) -> None:
        """Raise AlignError unless mask and normals (H, W, 3), if any, show an object."""
        mask = self.mask
        known = mask if normals is None else mask & np.isfinite(normals).all(-1)
        if known.sum() < 0.2 * mask.sum():
            raise AlignError(
                f"align: normals are known at {known.sum()} of the mask's {mask.sum()} pixels; expected most. "
                "Is the mask on the object?"
            )
        self.check_mask()

    def check_mask(self) -> None:
        """Raise AlignError unless the mask (H, W) shows an object."""
        if self.mask.sum() < 200:
            raise AlignError(f"mask: {self.mask.sum()} pixels are too few to place a scan; expected some thousand.")

    @property
    def cut_words(self) -> str:
        """What to say of a mask that the image's border cuts, where the scan finds no place; empty where it does not.

        A nibble at the border may be a fault of the mask; a stretch of it is the object leaving the picture.
        """
        mask = self.mask
        border = np.concatenate([mask[0], mask[-1], mask[1:-1, 0], mask[1:-1, -1]])
        if border.sum() <= max(4, 0.15 * math.sqrt(mask.sum())):
            return ""
        return (
            f" {border.sum()} of the mask's pixels lie on the image's border. If the object leaves the frame, reshoot "
            "with the whole of it in view; if it does not, give the mask: mask under [object], the object white."
        )


def shading_tells(lights: Lights) -> bool:
    """Return whether photographs under these lights tell a surface's normals from others: enough, of known lights."""
    return len(lights) >= FEWEST and not lights.is_unknown


def box_of(mask: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Return the rows and columns that hold a mask's pixels; the mask is not empty."""
    rows, columns = (np.flatnonzero(mask.any(axis)) for axis in (1, 0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def longer_side(mask: NDArray[np.bool_]) -> int:
    """Return the longer side of the box about a mask, pixels."""
    return max(side.stop - side.start for side in box_of(mask))


def sparse_normals(mask: NDArray[np.bool_], solve: Callable[[NDArray[np.bool_]], NDArray]) -> NDArray:
    """Return normals (H, W, 3) under a mask, of a large object solved on every k-th pixel of every k-th row only.

    A scan is placed with the object `ACROSS` pixels large; what more there is of normals would be averaged. `solve`
    takes a mask (H, W) and gives normals (H, W, 3), NaN where unknown; the k x k pixels about a solved one are given
    its normal.
    """
    step = max(1, (longer_side(mask) - 1) // ACROSS) if mask.any() else 1
    if step == 1:
        return solve(mask)
    grid = [np.arange(step // 2, count, step) for count in mask.shape]
    few = np.zeros_like(mask)
    few[np.ix_(*grid)] = mask[np.ix_(*grid)]
    nearest = [
        at[np.minimum(np.arange(count) // step, len(at) - 1)] for at, count in zip(grid, mask.shape, strict=True)
    ]
    return solve(few)[np.ix_(*nearest)]
