"""What the doubt about the camera's focal length leaves in doubt of the pose.

An object twice as far through a lens twice as long looks the same but for its perspective: of the two, the pictures of
one object tell little. Measured on virtual sessions (docs/registration.md), a focal length fitted with the pose was
hardly better than one from EXIF, and worse than its sigma said; normals gained nothing. So the camera is kept as it is
given, for all steps alike; the registration is repeated with a focal length one sigma longer, and what that changes is
part of the uncertainty.

It is assumed that the lights were calibrated with the same camera on balls of known size: with a longer lens the balls,
and the lights about them, stand farther away in the same proportion as the object, and light reaches it as before.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from align.pose.full_resolution import NEAREST_PX, FinalEvidence
from align.pose.scan_view import Probes
from scene.camera import Camera
from scene.lights import Lights
from scene.pose import Pose

Array = NDArray[np.float64]

EXACT = 0.001
"""Relative sigma of a focal length up to which it is taken as exact: it moves the object's place by less than the
registration's own uncertainty."""
ROUNDS = 2
"""Of the refinement; it starts within a pixel."""


@dataclass(frozen=True)
class LongerFocal:
    """The registration as it would be, were the focal length one sigma longer."""

    camera: Camera
    pose: Pose
    """camera_from_scan."""
    twist: Array
    """(6,): from the registration's pose to this one, for `align.pose.motion.nudge` about the scan's middle."""

    @property
    def covariance(self) -> Array:
        """(6, 6): the focal length's part of the pose's covariance; mostly depth, for which it passes."""
        return np.outer(self.twist, self.twist)


def register_longer(evidence: FinalEvidence) -> LongerFocal | None:
    """Repeat a finished registration with a focal length one sigma longer.

    None where the focal length is known (`EXACT`), and where the camera is orthographic.
    """
    from scipy.spatial.transform import Rotation

    seen, camera = evidence.seen, evidence.seen.camera
    if camera.is_orthographic or camera.focal_sigma <= EXACT:
        return None
    ratio = 1 + camera.focal_sigma
    middle_mm = seen.caster.mesh.center_mm
    pivot = evidence.pose.apply(middle_mm)
    pose = _receded(pivot, ratio) @ evidence.pose
    camera = replace(camera, fx=camera.fx * ratio, fy=camera.fy * ratio)
    probes = Probes.of(camera, seen.samples.pixels, step_px=seen.probes.step_px)
    there = replace(seen, camera=camera, lights=receded_lights(seen.lights, ratio), probes=probes)
    for _ in range(ROUNDS):
        pose = FinalEvidence.about(there, pose, reach_px=NEAREST_PX).settled()
    turn = Rotation.from_matrix((pose @ evidence.pose.inverse()).rotation).as_rotvec()
    shift = pose.apply(middle_mm) - pivot
    return LongerFocal(camera, pose, np.concatenate([turn, shift]))


def receded_lights(lights: Lights, ratio: float) -> Lights:
    """Return the lights as the same balls would have placed them with a focal length `ratio` times as long.

    A ball of known size has the same picture `ratio` times as far away, and the lights keep their places about it.
    """
    away = _receded(lights.reference_point_mm, ratio)
    positions = None if lights.positions_mm is None else away.apply(lights.positions_mm)
    return replace(lights, positions_mm=positions, reference_point_mm=away.apply(lights.reference_point_mm))


def _receded(point: Array, ratio: float) -> Pose:
    """Return the shift in depth that keeps a point's picture when the focal length is `ratio` times as long."""
    return Pose.from_rotation_translation(np.eye(3), [0.0, 0.0, (ratio - 1) * point[2]])
