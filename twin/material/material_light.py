"""Light that no flash sends straight: by way of the object's other parts, and from the room; rendered small."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from twin.description.description import Sampling
from twin.engines.light_layers import render_layers
from twin.engines.variant import import_mitsuba
from twin.material.material_samples import MaterialSamples
from twin.scan_scene import scan_scene
from twin.visibility import Sight

SIDE = 112
"""Pixels across the object: light from elsewhere changes slowly."""
SAMPLES, DEPTH = 64, 4


@dataclass(frozen=True, eq=False)
class OnwardLight:
    """Pixel values that come by way of two surfaces or three, and from the room, rendered small.

    images (F, h, w, 3): Of some of a picture that is `scale` times the camera's.
    row, column: Of that picture, where the images begin.
    """

    images: NDArray[np.float32]
    row: int
    column: int
    scale: float

    def at(self, rows: NDArray, columns: NDArray) -> NDArray[np.float32]:
        """Return (P, F, 3) at pixels (P,) of the camera: bilinear, of lit pixels alone, none of the black beside."""
        row, column = ((place + 0.5) * self.scale - 0.5 for place in (rows, columns))
        return _looked_up(self.images, row - self.row, column - self.column)

    def off(self, samples: MaterialSamples) -> MaterialSamples:
        """Return samples without that light."""
        return samples._replace(values=samples.values - self.at(samples.rows, samples.columns))


def onward_light(sight: Sight, samples: MaterialSamples, albedo: NDArray[np.float32]) -> OnwardLight:
    """Return the light that comes by way of the object's other parts, all of them matte, and from the room.

    What a highlight throws on another place is left out: narrow as it is, so few paths find it that they would put more
    noise into the samples than they take out.

    albedo (P, 3): Of the samples.
    Raises RenderError: No vectorised variant of Mitsuba runs here; and see `twin.scan_scene.scan_scene`.
    """
    import_mitsuba()
    across = max(int(np.ptp(samples.rows)), int(np.ptp(samples.columns))) + 1
    scale = min(1.0, SIDE / across)
    camera = sight.camera
    small = camera.scaled(int(np.ceil(camera.width * scale)), int(np.ceil(camera.height * scale)), scale, scale)
    row, column = ((place + 0.5) * scale - 0.5 for place in (samples.rows, samples.columns))
    sampling, picture = Sampling("many", SAMPLES, DEPTH), _picture(row, column, albedo, small)
    scene, _ = scan_scene(replace(sight, camera=small, normals=None), picture, sampling)
    film = scene.film()
    layers = render_layers(scene, film, "many", SAMPLES)
    assert layers.onward is not None
    images = layers.onward if layers.standing is None else layers.onward + layers.standing
    return OnwardLight(images, film.rows.start, film.columns.start, scale)


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
    seen = images.max((0, -1)) > 0
    total, weight = np.zeros((len(images), len(row), 3), np.float32), np.full(len(row), 1e-6, np.float32)
    for down in (0, 1):
        for right in (0, 1):
            i, j = np.floor(row).astype(int) + down, np.floor(column).astype(int) + right
            share = (1 - np.abs(row - i)) * (1 - np.abs(column - j))
            i, j = np.clip(i, 0, seen.shape[0] - 1), np.clip(j, 0, seen.shape[1] - 1)
            share = (share * seen[i, j]).astype(np.float32)
            total += share[:, None] * images[:, i, j]
            weight += share
    return np.moveaxis(total / weight[:, None], 0, 1)
