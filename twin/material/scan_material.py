"""The material of a registered scan, from photographs to albedo map: light from elsewhere off, fitted, divided."""

from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import RenderError
from scene.frames import Frames
from scene.lights import Lights
from twin.material.fit_material import MaterialFit, fit_material, matte_albedo, robust
from twin.material.material_light import onward_light
from twin.material.material_places import Places, material_places
from twin.material.material_residual import Part, Residual, material_residual
from twin.material.material_samples import MOST, Samples, samples_at, samples_of_scan
from twin.material.tilted_normals import foretells_better, likeliest_normals
from twin.visibility import Sight

SAMPLES_AT_ONCE = 1 << 18
TURNS = 2
"""Of albedo and light from elsewhere."""
MOST_SAMPLES, LEAST_PIXELS = 250_000, 4_000
"""Of the fit: pixels times frames; pixels, however many frames there are."""


@dataclass(frozen=True, eq=False)
class ScanMaterial:
    """What a scanned object is made of.

    fit: Of the whole object, as if it were of one material.
    places: One material, the same, or two.
    labels (H, W): Which of them a pixel of the mask is of; -1 beyond.
    samples, lights: What it was fitted to.
    onward: Light by way of other parts of the object, that was subtracted: root mean square over that of the values. 0
        where it could not be rendered.
    albedo (H, W, 3): Of the body: pixel value of what faces a light of intensity 1 where no coat is in the way. NaN
        where unknown.
    normals (H, W, 3): The likeliest ones, where they were asked for and foretell better than the scan's; the scan's
        beyond. None: the scan's.
    tilts: What was found about the normals; empty: nothing was asked.
    trouble: What went wrong on the way.
    """

    fit: MaterialFit
    places: Places
    labels: NDArray[np.int8]
    samples: Samples
    lights: Lights
    onward: float
    albedo: NDArray[np.float32]
    normals: NDArray[np.float32] | None = None
    tilts: str = ""
    trouble: tuple[str, ...] = ()

    @cached_property
    def residual(self) -> Residual:
        """What `places` leave, and what would explain it."""
        return _residual(self.samples, self.places, self.lights)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is suspicious about it."""
        fits = self.places.fits
        told = [f"Place {number + 1}: {text}" for number, fit in enumerate(fits) for text in fit.warnings]
        return (*(told if len(fits) > 1 else self.fit.warnings), *self.trouble, *self.residual.doubts)

    def facts(self) -> dict[str, Any]:
        """Return what the summary keeps of it; relative standard deviations, residuals and shares are not percents."""
        fits = self.places.fits
        whose = "tilted by the photographs" if self.normals is not None else "the scan's"
        sentence = f"{self.places}{f'; normals {whose}: {self.tilts}' if self.tilts else ''}"
        if len(fits) == 1:
            made_of = {"model": self.fit.model, "sentence": sentence, **_numbers(self.fit)}
        else:
            each = [
                {"share": share, "model": fit.model, "sentence": str(fit), **_numbers(fit)}
                for share, fit in zip(self.places.shares, fits, strict=True)
            ]
            made_of = {"model": "two materials", "sentence": sentence, "why": self.places.evidence}
            made_of |= {"places": each}
        return {
            **made_of,
            "samples_worth": self.fit.effective_samples,
            "onward": self.onward,
            "relative_rmse": self.residual.whole,
            "relative_rmse_per_frame": self.residual.per_frame,
            "explained_by": {name: asdict(part) for name, part in self.residual.parts.items()},
            "normals_refined": self.normals is not None,
        }

    def seen(self, sight: Sight) -> Sight:
        """Return the sight with the normals that go with this material."""
        return sight if self.normals is None else replace(sight, normals=self.normals)


def scan_material(
    sight: Sight, frames: Frames, mask: NDArray[np.bool_], *, sigma_deg: NDArray[np.float32] | None = None
) -> ScanMaterial:
    """Return the material of a registered scan.

    Parameters and errors: see `twin.material.material_samples.samples_of_scan`. `sigma_deg` (H, W): of the sight's
    normals, NaN where unknown; where it is given, the photographs may tilt them, if that foretells frames not fitted to
    better by more than chance.

    Notes
    -----
    Light from the object's other parts is rendered as if the object were matte, and subtracted from what is fitted and
    from what the albedo is measured in: else the twin would have it twice. After the fit, places of different gloss are
    looked for. A pixel that is no sample of the fit (outline, crease, grazing) gets its own albedo all the same.
    """
    lights = sight.lights
    most = min(MOST, max(LEAST_PIXELS, MOST_SAMPLES // len(frames)))
    samples = samples_of_scan(sight, frames, mask, most)
    onward, trouble, elsewhere = 0.0, (), None
    try:
        # The more is taken for albedo, the more light goes on, and the less albedo is left: halfway it settles.
        body = matte_albedo(samples)
        elsewhere = onward_light(sight, samples, body)
        for _ in range(TURNS):
            body = np.sqrt(body * matte_albedo(elsewhere.off(samples)))
            elsewhere = onward_light(sight, samples, body)
    except RenderError as error:
        trouble = (f"Light from elsewhere stayed in the fitted samples: {error}",)
    else:
        seen, usable = samples.values, samples.usable
        samples = elsewhere.off(samples)
        onward = float(np.linalg.norm((seen - samples.values)[usable]) / np.linalg.norm(seen[usable]))
    fit = fit_material(samples, lights)
    places = material_places(samples, lights, fit)
    labels = places.picture(samples, mask)
    normals, tilts = None, ""
    if sigma_deg is not None and sight.normals is not None:
        better, tilts = foretells_better(samples, fit, sigma_deg[samples.rows, samples.columns])
        if better:
            normals = np.array(sight.normals)
            samples = _tilted(samples, fit, sigma_deg)
    albedo = np.full((*mask.shape, 3), np.nan, np.float32)
    step = max(1, SAMPLES_AT_ONCE // len(frames))
    for lenient in (False, True):
        rows, columns = np.nonzero(mask & np.isnan(albedo[..., 0]))
        for first in range(0, len(rows), step):
            some = samples_at(sight, frames, rows[first : first + step], columns[first : first + step], lenient=lenient)
            for number, one in enumerate(places.fits):
                own = some.only(labels[some.rows, some.columns] == number)
                own = own if elsewhere is None else elsewhere.off(own)
                if normals is not None and sigma_deg is not None and len(own) and not lenient:
                    own = _tilted(own, one, sigma_deg)
                    normals[own.rows, own.columns] = own.normals
                if len(own):
                    albedo[own.rows, own.columns] = albedo_of(own, one)
    return ScanMaterial(fit, places, labels, samples, lights, onward, albedo, normals, tilts, trouble)


def albedo_of(samples: Samples, fit: MaterialFit) -> NDArray[np.float32]:
    """Return the albedo (P, 3) of samples of a fitted material."""
    return robust(samples, fit, fit.noise)[3]


def _tilted(samples: Samples, fit: MaterialFit, sigma_deg: NDArray[np.float32]) -> Samples:
    return replace(samples, normals=likeliest_normals(samples, fit, sigma_deg[samples.rows, samples.columns]))


def _numbers(fit: MaterialFit) -> dict[str, Any]:
    if fit.model == "matte":
        return {}
    names = ("roughness_sigma", "specularity", "specularity_sigma")
    return fit.surface.numbers() | {name: getattr(fit, name) for name in names}


def _residual(samples: Samples, places: Places, lights: Lights) -> Residual:
    """Return what places leave together; what would explain it is let free in each, and weighed by what each leaves."""
    if len(places.fits) == 1:
        return material_residual(samples, places.fits[0], lights)
    each = [samples.only(places.labels == number) for number in range(len(places.fits))]
    left = [material_residual(some, fit, lights) for some, fit in zip(each, places.fits, strict=True)]
    bright = np.stack([np.sum(np.where(some.usable, np.sum(some.values**2, -1), 0), 0) for some in each])
    squares = np.stack([np.nan_to_num(one.per_frame) ** 2 for one in left]) * bright
    with np.errstate(invalid="ignore"):
        per_frame = np.sqrt(squares.sum(0) / bright.sum(0))
    weight = squares.sum(1) / max(squares.sum(), 1e-300)
    parts = {}
    for name, first in left[0].parts.items():
        own = [one.parts[name] for one in left]
        size, expected = (
            float(np.sqrt(sum(w * getattr(part, key) ** 2 for w, part in zip(weight, own, strict=True))))
            for key in ("size", "expected")
        )
        explains, foretells = (
            float(sum(w * getattr(part, key) for w, part in zip(weight, own, strict=True)))
            for key in ("explains", "foretells")
        )
        parts[name] = Part(explains, size, first.unit, expected, foretells)
    return Residual(float(np.sqrt(squares.sum() / bright.sum())), per_frame, parts)
