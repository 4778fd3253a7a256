"""What a scan is registered to: the photographs of an object, and what is known of them before."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from align.pose.scan_view import box_of, signed_distance
from scene.camera import Camera
from scene.errors import AlignError
from scene.frames import Frames
from scene.lights import Lights
from scene.spheres import Sphere

ACROSS = 500
"""Pixels across the object: by no more a scan's first poses are found."""
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
        self.check_mask()
        asked = thinned(self.mask)
        known = asked if normals is None else asked & np.isfinite(normals).all(-1)
        if known.sum() < max(0.2 * asked.sum(), 1):
            raise AlignError(
                f"align: normals are known at {known.sum()} of {asked.sum()} pixels of the mask; expected most. "
                "Is the mask on the object?"
            )

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


def longer_side(mask: NDArray[np.bool_]) -> int:
    """Return the longer side of the box about a mask, pixels."""
    return max(side.stop - side.start for side in box_of(mask))


def step_across(mask: NDArray[np.bool_]) -> int:
    """Return n such that every n-th pixel of every n-th row leaves a mask at most `ACROSS` pixels large."""
    return max(1, -(-longer_side(mask) // ACROSS)) if mask.any() else 1


def thinned(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return those pixels of a mask alone: normals elsewhere serve no search."""
    few, step = np.zeros_like(mask), step_across(mask)
    few[::step, ::step] = mask[::step, ::step]
    return few
