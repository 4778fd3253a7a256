"""What a registration looks at: a scan and its photographs, and what of both does not depend on the pose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.appearance import Lit
from align.pose.outline_edges import EdgePictures
from align.pose.photographed import Photographs, longer_side
from align.pose.scan_outline import signed_distance
from align.pose.scan_view import Probes
from align.pose.shading import Samples, take_samples
from scene.camera import Camera
from scene.lights import Lights
from scene.rays import RayCaster

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Observed:
    """A scan and its photographs: what of them does not depend on the pose."""

    caster: RayCaster
    camera: Camera
    lights: Lights
    mask: NDArray[np.bool_]
    """(H, W): the object's, as it was found."""
    distance: NDArray[np.float32]
    """(H, W), to its border; see `signed_distance`."""
    near: NDArray[np.float32]
    """(H, W), to where the outline is: the same, or to the border of the scan's silhouette at a pose that is known."""
    pictures: EdgePictures | None
    """None: the mask's border is the edge."""
    samples: Samples
    probes: Probes
    """At the samples' pixels."""
    cells: int
    """Of the raster on which the outline is searched, across the scan."""
    lights_known: bool = True
    """Else the object is taken for matte, and what its surroundings send back for the lights' own."""

    @classmethod
    def of(
        cls,
        caster: RayCaster,
        photographs: Photographs,
        pictures: EdgePictures | None,
        *,
        count: int,
        cells: int,
        silhouette: NDArray[np.bool_] | None = None,
        lights_known: bool = True,
    ) -> "Observed":
        """Read about `count` pixels of the object, or of the scan's `silhouette` (H, W), from all frames."""
        camera, mask = photographs.camera, photographs.mask
        distance = photographs.distance
        near = distance if silhouette is None else signed_distance(silhouette)
        samples = take_samples(photographs.frames, photographs.lights, near < 0, count=count)
        probes = Probes.of(camera, samples.pixels, step_px=1.0)
        known = caster, camera, photographs.lights, mask, distance, near, pictures
        return cls(*known, samples, probes, cells, lights_known)

    def toward(self, points: Array) -> Array:
        """Return the light vectors (N, P, 3) at points (P, 3), of intensity 1; anything where the scan is missed."""
        return self.lights.toward(np.where(np.isfinite(points), points, self.lights.reference_point_mm))

    def lit(self, points: Array, scale: float = 1.0) -> Lit:
        """Return the lights at points (P, 3) of a scan `scale` times as large and as far."""
        return Lit.of(self.toward(scale * points), -self.probes.directions[0])

    @property
    def near_px(self) -> float:
        """How far beside an edge an outline is still on it: 1 px, or 0.5 % of the object's size."""
        return max(1.0, 0.005 * longer_side(self.mask))

    def patches(self, pixels: NDArray) -> NDArray[np.int64]:
        """Return the number (K,) of the patch that holds each pixel (K, 2), 16 patches across the object."""
        return patches(pixels, max(4.0, longer_side(self.mask) / 16))


def patches(pixels: NDArray, size_px: float) -> NDArray[np.int64]:
    """Return the number (K,) of the square patch of the image that holds each pixel (K, 2)."""
    cell = (pixels / size_px).astype(np.int64)
    return cell[:, 1] * 100_000 + cell[:, 0]
