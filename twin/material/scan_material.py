"""The material of a registered scan, from photographs to albedo map: light from elsewhere off, fitted, divided."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import RenderError
from scene.frames import Frames
from twin.material.fit_material import MaterialFit, fit_material, matte_albedo, robust_albedo
from twin.material.material_kernels import predicted
from twin.material.material_light import OnwardLight, onward_light
from twin.material.material_samples import MOST, MaterialSamples, samples_at, samples_of_scan
from twin.material.reflection_models import reflected
from twin.visibility import Sight

Array = NDArray[np.float64]

SAMPLES_AT_ONCE = 1 << 18
MOST_SAMPLES, LEAST_PIXELS = 120_000, 4_000
"""Of the fit: pixels times frames; pixels, however many frames there are."""

METAL_VARIES = 2.0
"""Factor between a metal's albedo and its median, at most."""


@dataclass(frozen=True, eq=False)
class ScanMaterial:
    """What a scanned object is made of.

    onward_share: Root mean square of light by way of other parts of the object and from the room, which was
        subtracted, over that of the values.
    albedo (H, W, 3): Of the body: pixel value of what faces a light of intensity 1 where no coat is in the way; of a
        metal, that where all of its facets mirror the light. NaN where unknown.
    relative_rmse: Root of the squared residuals' sum over the squared values', usable samples, all channels.
    per_frame (F,): The same of each frame; NaN of one without samples.
    trouble: What went wrong on the way.
    """

    fit: MaterialFit
    onward_share: float
    albedo: NDArray[np.float32]
    relative_rmse: float
    per_frame: Array
    trouble: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is suspicious about it."""
        return (*self.fit.warnings, *self.trouble)

    def facts(self) -> dict[str, Any]:
        """Return what the summary keeps of it; relative standard deviations, residuals and shares are not percents."""
        fit, numbers = self.fit, {}
        if fit.model == "metal":
            numbers = {"roughness": fit.surface.roughness}
        elif fit.model != "matte":
            names = ("roughness_sigma", "specularity", "specularity_sigma")
            numbers = fit.surface.numbers() | {name: getattr(fit, name) for name in names}
        return {
            "model": fit.model,
            "sentence": str(fit),
            **numbers,
            "samples_worth": fit.effective_samples,
            "onward": self.onward_share,
            "relative_rmse": self.relative_rmse,
            "relative_rmse_per_frame": self.per_frame,
        }


def scan_material(sight: Sight, frames: Frames, mask: NDArray[np.bool_]) -> ScanMaterial:
    """Return the material of a registered scan.

    Parameters and errors: see `twin.material.material_samples.samples_of_scan`.

    Notes
    -----
    Light from the object's other parts is rendered as if the object were matte, and subtracted from what is fitted and
    from what the albedo is measured in: else the twin would have it twice. A pixel that is no sample of the fit
    (outline, crease, grazing) gets its own albedo all the same.
    """
    most = min(MOST, max(LEAST_PIXELS, MOST_SAMPLES // len(frames)))
    trouble: tuple[str, ...] = ()
    seen, onward = samples_of_scan(sight, frames, mask, most), None
    try:
        onward = _settled(sight, seen)
    except RenderError as error:
        trouble = (f"Light from elsewhere stayed in the fitted samples: {error}",)
    samples = seen if onward is None else onward.off(seen)
    usable = samples.usable
    gone = float(np.linalg.norm((seen.values - samples.values)[usable]) / np.linalg.norm(seen.values[usable]))
    fit = fit_material(samples, sight.lights)
    albedo = np.full((*mask.shape, 3), np.nan, np.float32)
    step = max(1, SAMPLES_AT_ONCE // len(frames))
    for lenient in (False, True):
        rows, columns = np.nonzero(mask & np.isnan(albedo[..., 0]))
        for first in range(0, len(rows), step):
            own = samples_at(sight, frames, rows[first : first + step], columns[first : first + step], lenient=lenient)
            own = own if onward is None else onward.off(own)
            if len(own.rows):
                albedo[own.rows, own.columns] = robust_albedo(own, fit, fit.noise)
    if fit.model == "metal":
        # Where no light was mirrored toward the camera next to nothing is divided by next to nothing: the half of the
        # samples that mirror most tell what is usual.
        mirrored = (reflected(fit.surface, samples.normals, samples.views, samples.toward)[0] * samples.usable).sum(1)
        brighter = samples.only(mirrored >= np.median(mirrored))
        usual = np.median(robust_albedo(brighter, fit, fit.noise), axis=0)
        albedo = np.clip(albedo, usual / METAL_VARIES, usual * METAL_VARIES)
    return ScanMaterial(fit, gone, albedo, *_left(samples, fit), trouble)


def _settled(sight: Sight, samples: MaterialSamples) -> OnwardLight:
    """Return light from elsewhere that goes with the albedo: more of one leaves less of the other, halfway it settles.

    Raises RenderError: It cannot be rendered.
    """
    body = matte_albedo(samples)
    if (room := sight.lights.room_share) is not None:
        # Values of a (s + room), s the flash's shading, are fitted by a (1 + room sum(s) / sum(s^2)) s.
        cosine = np.einsum("pi,pfi->pf", samples.normals, samples.toward) * samples.usable
        flash = cosine[..., None] * samples.irradiance
        body = body / (1 + room * flash.sum(1) / np.sum(flash**2, 1)).astype(np.float32)
    onward = onward_light(sight, samples, body)
    return onward_light(sight, samples, np.sqrt(body * matte_albedo(onward.off(samples))))


def _left(samples: MaterialSamples, fit: MaterialFit) -> tuple[float, Array]:
    """Return `ScanMaterial.relative_rmse` and `per_frame`."""
    weights = np.repeat(samples.usable[..., None], 3, -1).astype(np.float32)
    values = predicted(samples, weights, fit.surface, fit.strength)[0]
    square, bright = (
        np.sum(np.where(samples.usable, np.sum(a.astype(np.float64) ** 2, -1), 0), 0)
        for a in (samples.values - values, samples.values)
    )
    with np.errstate(invalid="ignore"):
        return float(np.sqrt(square.sum() / bright.sum())), np.sqrt(square / bright)
