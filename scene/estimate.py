"""What a photometric-stereo method recovered."""

from dataclasses import dataclass, field
from html import escape

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights

SHOWN_WIDTH = 360
"""Pixels of the picture in a notebook: a whole map of 24 megapixels would make it as large."""


@dataclass(frozen=True)
class Estimate:
    """Normals and albedo of one method on one stack.

    Parameters
    ----------
    method : str
        `ls`, `iterative`, ...
    normals : (H, W, 3) float32
        Unit, camera frame, NaN where unknown.
    albedo : (H, W, 3) float32
        Pixel value under a light of intensity 1 along the normal, RGB, NaN where unknown.
    samples : (H, W) uint16
        How many frames each pixel was fitted to; 0 where unknown.
    seconds, processor_seconds : float
        Of the method itself, by the clock on the wall and of processors.
    settings : dict
        The options that it ran with.
    warnings : tuple of str
        Why the method should not be believed here.
    sigma_deg : (H, W) float32 or None
        Standard deviation of the normal along one tangent axis, from the scatter of the residuals: noise that
        differs from sample to sample, not what all samples share. NaN where three samples or fewer were fitted. Of
        `metal` how far apart the normals are that explain the pixel.
    lights : Lights or None
        What the method itself found of the lights, where it does.
    z_mm : (H, W) float64 or None
        Depth, camera frame, of methods that find it; NaN outside the mask.
    """

    method: str
    normals: NDArray[np.float32]
    albedo: NDArray[np.float32]
    samples: NDArray[np.uint16]
    seconds: float = 0.0
    processor_seconds: float = 0.0
    settings: dict = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    sigma_deg: NDArray[np.float32] | None = None
    lights: Lights | None = None
    z_mm: NDArray[np.float64] | None = None

    def __repr__(self) -> str:
        height, width = self.normals.shape[:2]
        known = int(np.isfinite(self.normals[..., 0]).sum())
        text = f"{self.method}: normals of {known:,} of {width} x {height} pixels"
        if self.sigma_deg is not None and np.isfinite(self.sigma_deg).any():
            text += f", sigma {np.nanmedian(self.sigma_deg):.2g} degrees (median)"
        text, doubts = f"{text}, {self.processor_seconds:.1f} processor s", len(self.warnings)
        return text + (f", {doubts} warning{'s' * (doubts > 1)}" if doubts else "")

    def _repr_html_(self) -> str:
        from scene.map_pictures import data_uri, normal_picture

        picture = normal_picture(self.normals, SHOWN_WIDTH)
        shown = f'<img src="{data_uri(picture, photograph=False)}" alt="normals">'
        doubts = "".join(f"<p>warning: {escape(text)}</p>" for text in self.warnings)
        return f"<p>{escape(repr(self))}</p>{shown}{doubts}"
