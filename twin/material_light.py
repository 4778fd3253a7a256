"""Light that reaches a sample by way of the object's other parts: rendered small, with the material found so far."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.lights import Lights
from scene.mesh import Mesh
from scene.pose import Pose
from twin.description import Sampling, TwinScene
from twin.fit_material import MaterialFit
from twin.material_samples import Samples
from twin.materials import Diffuse, RoughPlastic
from twin.mitsuba_scene import mitsuba_scene
from twin.scan_scene import scan_scene

SIDE = 112
"""Pixels across the object: light from elsewhere changes slowly."""
SAMPLES, DEPTH = 36, 4


def material_scene(
    fit: MaterialFit,
    albedo: NDArray[np.float32],
    mesh: Mesh,
    pose: Pose,
    camera: Camera,
    lights: Lights,
    sampling: Sampling,
) -> tuple[TwinScene, tuple[str, ...]]:
    """Return the scene of a scan made of a fitted material, and what is suspicious about it.

    Parameters and errors: see `twin.scan_scene.scan_scene`; `albedo` (H, W, 3) is that of the fit, of the body.
    """
    scene, warnings = scan_scene(mesh, pose, camera, lights, albedo, sampling=sampling)
    if fit.model == "matte":
        return scene, warnings
    ((name, body),) = scene.materials.items()
    assert isinstance(body, Diffuse)
    # Where the white value is unknown, the scene has taken one.
    specularity = float(np.mean(fit.strength) / np.mean(scene.white))
    glossy = RoughPlastic(body.reflectance, fit.roughness, min(specularity, 1.0), fit.index, covered=fit.covered)
    return replace(scene, materials={name: glossy}), warnings


def onward_light(
    samples: Samples,
    fit: MaterialFit,
    albedo: NDArray[np.float32],
    mesh: Mesh,
    pose: Pose,
    camera: Camera,
    lights: Lights,
) -> NDArray[np.float32]:
    """Return (P, F, 3), pixel values that come by way of two surfaces or three, all of them matte.

    What a highlight throws on another place is left out: narrow as it is, so few paths find it that they would put more
    noise into the samples than they take out.

    Parameters
    ----------
    samples, fit, mesh, pose, camera, lights
        As the fit had them.
    albedo : (P, 3) float32
        Of the samples.

    Raises
    ------
    RenderError
        No vectorised variant of Mitsuba runs here; and see `twin.scan_scene.scan_scene`.
    """
    from twin.flashes import import_mitsuba
    from twin.many import Indirect

    import_mitsuba()
    across = max(int(np.ptp(samples.rows)), int(np.ptp(samples.columns))) + 1
    scale = min(1.0, SIDE / across)
    small = camera.scaled(int(np.ceil(camera.width * scale)), int(np.ceil(camera.height * scale)), scale, scale)
    row, column = ((place + 0.5) * scale - 0.5 for place in (samples.rows, samples.columns))
    body, sampling = replace(fit, model="matte"), Sampling("many", SAMPLES, DEPTH)
    scene, _ = material_scene(body, _picture(row, column, albedo, small), mesh, pose, small, lights, sampling)
    film = scene.film()
    images = Indirect(mitsuba_scene(scene), film, scene.lights, samples=SAMPLES, max_depth=DEPTH).images()
    return _looked_up(images, row - film.rows.start, column - film.columns.start)


def _picture(row: NDArray, column: NDArray, albedo: NDArray[np.float32], small: Camera) -> NDArray[np.float32]:
    """Return (H, W, 3), the samples' mean in each small pixel; NaN where there is none."""
    place = np.round(row).astype(int) * small.width + np.round(column).astype(int)
    place = np.clip(place, 0, small.width * small.height - 1)
    count = np.bincount(place, minlength=small.width * small.height)
    total = np.stack([np.bincount(place, albedo[:, c], len(count)) for c in range(3)], -1)
    with np.errstate(invalid="ignore"):
        return (total / count[:, None]).reshape(small.height, small.width, 3).astype(np.float32)


def _looked_up(images: NDArray[np.float32], row: NDArray, column: NDArray) -> NDArray[np.float32]:
    """Return (P, F, 3) of images (F, h, w, 3), bilinear, of lit pixels alone: none of the black behind the object."""
    import cv2

    seen = (images.max((0, -1)) > 0).astype(np.float32)
    at = column.astype(np.float32), row.astype(np.float32)

    def look(image: Any) -> NDArray:
        return np.asarray(cv2.remap(image, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)).reshape(
            len(row), -1
        )

    share = np.maximum(look(seen), 1e-6)
    return np.stack([look(image) / share for image in images], 1).astype(np.float32)
