"""The material of a registered scan, from photographs to albedo map: fitted, light from elsewhere off, fitted again."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import RenderError
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.pose import Pose
from twin.fit_material import MaterialFit, fit_material
from twin.material_kernels import predicted
from twin.material_light import onward_light
from twin.material_residual import Residual, material_residual
from twin.material_samples import MOST, Samples, ScanSurface, inner_pixels, samples_of_scan

SAMPLES_AT_ONCE = 1 << 22
MOST_SAMPLES, LEAST_PIXELS = 250_000, 4_000
"""Of the fit: pixels times frames; pixels, however many frames there are."""


@dataclass(frozen=True, eq=False)
class ScanMaterial:
    """What a scanned object is made of.

    Parameters
    ----------
    fit : MaterialFit
    residual : Residual
    onward : float
        Light by way of other parts of the object, that was subtracted: root mean square over that of the values. 0
        where it could not be rendered.
    albedo : (H, W, 3) float32
        Of the body: pixel value of what faces a light of intensity 1 where no coat is in the way. NaN where unknown.
    """

    fit: MaterialFit
    residual: Residual
    onward: float
    albedo: NDArray[np.float32]

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is suspicious about it."""
        return (*self.fit.warnings, *self.residual.doubts)

    def facts(self) -> dict[str, Any]:
        """Return what the summary keeps of it; relative standard deviations, residuals and shares are not percents."""
        fit = self.fit
        numbers = ("roughness", "roughness_sigma", "specularity", "specularity_sigma", "index", "covered")
        return {
            "model": fit.model,
            "sentence": str(fit),
            **({} if fit.model == "matte" else {name: getattr(fit, name) for name in numbers}),
            "samples_worth": fit.effective_samples,
            "onward": self.onward,
            "relative_rmse": self.residual.whole,
            "relative_rmse_per_frame": self.residual.per_frame,
            "explained_by": {name: asdict(part) for name, part in self.residual.parts.items()},
        }


def scan_material(
    frames: Frames,
    lights: Lights,
    camera: Camera,
    mask: NDArray[np.bool_],
    mesh: Mesh,
    pose: Pose,
    *,
    normals: NDArray[np.float32] | None = None,
    most: int | None = None,
) -> ScanMaterial:
    """Return the material of a registered scan.

    Parameters and errors: see `twin.material_samples.samples_of_scan`; `most` follows from the number of frames.

    Notes
    -----
    Light from the object's other parts is rendered with the first fit's material and subtracted, once: a second time
    changes nothing that can be seen. The albedo map holds what little of it is left in each pixel.
    """
    if most is None:
        most = min(MOST, max(LEAST_PIXELS, MOST_SAMPLES // len(frames)))
    samples = samples_of_scan(frames, lights, camera, mask, mesh, pose, normals=normals, most=most)
    fit, onward = fit_material(samples, lights), 0.0
    try:
        elsewhere = onward_light(samples, fit, albedo_of(samples, fit), mesh, pose, camera, lights)
    except RenderError as error:
        fit = replace(fit, warnings=(*fit.warnings, f"Light from elsewhere stayed in the fitted samples: {error}"))
    else:
        usable = samples.usable
        onward = float(np.sqrt(np.sum(elsewhere[usable] ** 2) / np.sum(samples.values[usable] ** 2)))
        samples = replace(samples, values=samples.values - elsewhere)
        fit = fit_material(samples, lights)
    albedo = np.full((camera.height, camera.width, 3), np.nan, np.float32)
    surface = ScanSurface(camera, mesh, pose, normals)
    rows, columns = inner_pixels(mask, normals)
    step = max(1, SAMPLES_AT_ONCE // len(frames))
    for first in range(0, len(rows), step):
        some = surface.samples(frames, lights, rows[first : first + step], columns[first : first + step])
        albedo[some.rows, some.columns] = albedo_of(some, fit)
    return ScanMaterial(fit, material_residual(samples, fit, lights), onward, albedo)


def albedo_of(samples: Samples, fit: MaterialFit) -> NDArray[np.float32]:
    """Return the albedo (P, 3) of samples of a fitted material."""
    everywhere = np.broadcast_to(fit.strength, (len(samples), 3))
    weights = np.repeat(samples.usable[..., None], 3, -1).astype(np.float32)
    for _ in range(2):
        values, slope, _ = predicted(samples, weights, fit.surface, everywhere)
        variance = np.maximum(fit.noise.variance(values, slope), 1e-12)
        robust = 5 / (4 + (samples.values - values) ** 2 / variance)
        weights = np.where(samples.usable[..., None], robust / variance, 0).astype(np.float32)
    return predicted(samples, weights, fit.surface, everywhere)[2]
