"""What the camera saw of one pixel under every light, and what each solver says that it should have seen."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compare.report.facts import family, read_optional
from scene.errors import SceneError
from scene.lights import Lights
from scene.normals import angular_error_deg
from studio.results.result_maps import TRUTH, Results, Side, Source

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Numbers:
    """A solver's answer at a pixel; NaN where it gave none.

    normal, albedo (3,).
    error_deg: Of the normal against the ground truth; NaN off the mask.
    """

    source: Source
    normal: Array
    albedo: Array
    error_deg: float
    sigma_deg: float


@dataclass(frozen=True, eq=False)
class Fit:
    """What a solver's answer means for every light; NaN where it gave none.

    shade (F,): n . l, times a near light's fall-off.
    gray (F,): albedo max(0, shade), gray and divided by the light's intensity as `Pixel.gray` is.
    note: Why this is not quite the solver's own prediction; empty where it is.
    """

    source: Source
    shade: Array
    gray: Array
    note: str = ""


@dataclass(frozen=True, eq=False)
class Pixel:
    """One pixel's samples.

    gray (F,): Each sample divided by its light's intensity, channel by channel, then gray as the solvers see it.
    clipped, shadowed (F,): At the sensor's white; under the share of the stack's 99th percentile from which solvers
    call a sample lit.
    true_shade (F,): n . l of the ground truth, NaN where there is none.
    """

    u: int
    v: int
    side: Side
    names: tuple[str, ...]
    gray: Array
    clipped: NDArray[np.bool_]
    shadowed: NDArray[np.bool_]
    true_shade: Array
    fits: tuple[Fit, ...]


def lit_from(results: Results, side: Side) -> float:
    """Return the gray value under which a sample of a side is called shadowed; NaN without a mask."""
    from solve.assess import DARK
    from solve.samples import scale_of

    frames, lights = results.frames(side)
    mask = results.review.material.mask
    return float("nan") if mask is None or not mask.any() else DARK * scale_of(frames, lights, mask)


def read_pixel(results: Results, side: Side, u: int, v: int, *, lit_from: float) -> Pixel:
    """Return a pixel's samples and every solver's fit, by the frames and the maps of a side."""
    from solve.samples import GRAY

    frames, lights = results.frames(side)
    row, column = slice(v, v + 1), slice(u, u + 1)
    samples = frames.read(row, columns=column)[:, 0, 0].astype(np.float64)
    clipped = frames.saturated(row, columns=column)[:, 0, 0]
    gray = (samples / lights.intensities) @ GRAY
    truth = results.at("normals", TRUTH, u, v)
    toward, _ = _toward(results, lights, TRUTH, u, v)
    fits = tuple(_fit(results, lights, Source(method, side), u, v) for method in results.methods)
    return Pixel(u, v, side, frames.names, gray, clipped, gray < lit_from, toward @ truth, fits)


def numbers_at(results: Results, u: int, v: int) -> list[Numbers]:
    """Return every solver's answer at a pixel, of the photographs and of the twin, and first the ground truth."""
    truth, mask = results.at("normals", TRUTH, u, v), results.review.material.mask
    counts = mask is None or bool(mask[v, u])
    rows = []
    for source in [TRUTH, *results.sources[:-1]]:
        normal, albedo = results.at("normals", source, u, v), results.at("albedo", source, u, v)
        error = float(angular_error_deg(normal, truth)) if counts and source != TRUTH else float("nan")
        rows.append(Numbers(source, normal, albedo, error, float(results.at("sigma", source, u, v))))
    return rows


def _fit(results: Results, lights: Lights, source: Source, u: int, v: int) -> Fit:
    """Return a solver's fit.

    Its albedo is the pixel's value under its own lights of intensity 1. Where it found intensities I' of its own, the
    pixel's value is albedo I' max(0, n . l); divided by the calibrated I it stands beside the samples.
    """
    from solve.samples import GRAY

    normal, albedo = results.at("normals", source, u, v), results.at("albedo", source, u, v)
    toward, note = _toward(results, lights, source, u, v)
    own, more = _own_intensities(results, lights, source)
    shade = toward @ normal
    gray = np.maximum(shade, 0) * ((albedo * own / lights.intensities) @ GRAY)
    return Fit(source, shade, gray, note or more)


def _toward(results: Results, lights: Lights, source: Source, u: int, v: int) -> tuple[Array, str]:
    """Return the light vectors (F, 3) of intensity 1 at a pixel, where a solver saw it, and what is not known of them.

    A near light is taken at the depth that the solver found, else at that of the lights' reference point, as it did.
    """
    if lights.positions_mm is None:
        # Such a method may have placed the lights, and keeps no record of where.
        placed = np.isfinite(results.at("depth", source, u, v))
        return lights.directions, "under distant lights, not under the near ones that it assumed" if placed else ""
    camera = results.review.material.camera
    if camera is None:
        return np.full((len(lights), 3), np.nan), f"no camera: {results.review.missing['camera']}"
    depth = float(results.at("depth", source, u, v))
    z_mm = depth if np.isfinite(depth) else float(lights.reference_point_mm[2])
    return lights.toward(camera.points_at_depth([[u, v]], z_mm))[:, 0], ""


def _own_intensities(results: Results, lights: Lights, source: Source) -> tuple[Array, str]:
    """Return the intensities (F, 3) that a solver fitted under, and what is not known of them."""
    if family(source.method) == "external":
        return lights.intensities, "under the calibrated lights; what the program did is not known"
    if source.method == "reflectance":
        return lights.intensities, "the matte part alone; the method fits gloss, too"
    rows = (read_optional(results.review.store, "summary.json") or {}).get("solve") or {}
    found = ((rows.get("methods") or {}).get(source.method) or {}).get("intensities")
    if found is None:
        return lights.intensities, ""
    if family(source.method) == "uncalibrated":
        return lights.intensities, "under the calibrated lights, not under its own"
    if source.side == "twin" or np.shape(found) != lights.intensities.shape:
        return lights.intensities, "under the calibrated intensities, not under its own"
    # In the summary their mean is 1; the scale that the solver used is the calibrated ones', by the geometric mean.
    own = np.asarray(found, np.float64)
    return own / np.exp(np.mean(np.log(own / lights.intensities), axis=0)), ""


def shade_of(pixel: Pixel, reference: str) -> Array:
    """Return n . l (F,) by the normal of a method or of the ground truth, which its `method` names."""
    found = {fit.source.method: fit.shade for fit in pixel.fits} | {TRUTH.method: pixel.true_shade}
    shade = found.get(reference, np.full(len(pixel.gray), np.nan))
    if not np.isfinite(shade).any():
        raise SceneError(f"{reference}: no normal at pixel {pixel.u}, {pixel.v}.")
    return shade
