"""Two lengths that a finished registration was given: the camera's focal length, and the scan's scale.

Focal length: an object twice as far through a lens twice as long looks the same but for its perspective: of the two,
the pictures of one object tell little. Measured on virtual sessions (docs/evidence/registration.md), a focal length
fitted with the pose was hardly better than one from EXIF, and worse than its sigma said; normals gained nothing. So the
camera is kept as it is given, for all steps alike; what a focal length one sigma longer changes is part of the
uncertainty.

It is assumed that the lights were calibrated with the same camera on balls of known size: with a longer lens the balls,
and the lights about them, stand farther away in the same proportion as the object, and light reaches it as before.

Scale: the picture does not tell it, as a larger object farther away looks the same. But near lights reach it otherwise
there, and where they stand is known in the millimetres of the balls' diameters. So is the table, where four balls
stand on it: a scan that is too large reaches into it.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from align.pose.full_resolution import UNMODELLED, FinalEvidence
from align.pose.refine import Term
from scene.camera import Camera
from scene.mesh import Mesh
from scene.pose import Pose
from scene.spheres import Sphere, table_under

Array = NDArray[np.float64]

EXACT = 0.001
"""Relative sigma of a focal length up to which it is taken as exact: it moves the object's place by less than the
registration's own uncertainty."""
SCALE_ROUNDS = 4
"""Of the refinement; it starts within a pixel."""
STEP = 0.02
"""Of log scale, for its slope."""
SUSPICIOUS, DEVIATIONS = 0.04, 4.0
"""How far from 1 a scale must be, and by how many of its sigmas, for a word. Sound sessions stay within 0.02."""
DEEP = 3.0
"""Sigmas by which a scan must lie in the table for a word: what lies in sand does, too."""


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
    """Return where a registered scan stands with a focal length one sigma longer: as much farther away.

    Registered again on virtual sessions it turned by under 0.02 degrees for 2 % of focal length. None where the focal
    length is known (`EXACT`), and where the camera is orthographic.
    """
    camera = evidence.seen.camera
    if camera.is_orthographic or camera.focal_sigma <= EXACT:
        return None
    ratio = 1 + camera.focal_sigma
    pivot = evidence.pose.apply(evidence.seen.caster.mesh.center_mm)
    pose = _receded(pivot, ratio) @ evidence.pose
    camera = replace(camera, fx=camera.fx * ratio, fy=camera.fy * ratio)
    shift = pose.apply(evidence.seen.caster.mesh.center_mm) - pivot
    return LongerFocal(camera, pose, np.concatenate([np.zeros(3), shift]))


def _receded(point: Array, ratio: float) -> Pose:
    """Return the shift in depth that keeps a point's picture when the focal length is `ratio` times as long."""
    return Pose.from_rotation_translation(np.eye(3), [0.0, 0.0, (ratio - 1) * point[2]])


@dataclass(frozen=True)
class FreeScale:
    """By how much larger the scan would have to be for the lights to explain its shading best."""

    scale: float
    sigma: float
    """Relative."""

    @property
    def warning(self) -> str | None:
        """What to say of a scale that is not 1; None where it may be."""
        log = float(np.log(self.scale))
        if abs(log) < max(SUSPICIOUS, DEVIATIONS * self.sigma):
            return None
        small, large = ("small", "large") if log > 0 else ("large", "small")
        return (
            f"scan: under these lights its shading fits best if it were {self.scale:.3f} times as large (+- "
            f"{self.sigma:.1%}). One length is wrong: the scan is too {small} (scan_unit), or diameter_mm of all the "
            f"balls is too {large}, or the lights' file is in another unit. Lights and distance are wrong "
            "until then: measure a ball and the object with calipers."
        )


def free_scale(evidence: FinalEvidence) -> FreeScale | None:
    """Return the scale of a scan under near lights, None where nothing tells it: distant lights.

    Gauss-Newton on the pose's six unknowns and the logarithm of the scale, with the evidence's own terms; the lights'
    vectors at a point p of a scan s times as large are those at s p. The sigma is that of the pose, made the same way.
    """
    lights, pose = evidence.seen.lights, evidence.pose
    if lights.positions_mm is None or evidence.seen.camera.is_orthographic:
        return None
    units = np.append(evidence.steps(1.0), 0.01)
    log, matrix = 0.0, np.zeros((7, 7))
    for _ in range(SCALE_ROUNDS):
        around = [evidence.shading(pose, float(np.exp(log + side))) for side in (-STEP, 0.0, STEP)]
        slope = (around[2].residuals - around[0].residuals) / (2 * STEP)
        shading = _with_column(around[1], slope)
        outline, _, bias = evidence.terms(pose)
        matrix, pull = np.zeros((7, 7)), np.zeros(7)
        for term in (shading, _with_column(outline, None), _with_column(bias, None)):
            known_of, slope_of, _ = term.information(units)
            matrix += known_of
            pull += slope_of
        step = -np.linalg.lstsq(matrix, pull, rcond=1e-9)[0][6] * units[6]
        log = float(np.clip(log + np.clip(step, -0.15, 0.15), -1.5, 1.5))
        if abs(step) < 1e-3:
            break
    variance = UNMODELLED * float(np.linalg.pinv(matrix, rcond=1e-12, hermitian=True)[6, 6]) * units[6] ** 2
    return FreeScale(float(np.exp(log)), float(np.sqrt(variance)))


def _with_column(term: Term, column: Array | None) -> Term:
    more = np.zeros(len(term.residuals)) if column is None else column
    return Term(term.residuals, np.column_stack([term.jacobian, more]), term.blocks, term.weight)


@dataclass(frozen=True)
class OnTable:
    """Where a registered scan lies above the table on which four balls or more stand."""

    lowest_mm: float
    """Of its lowest point, above the table."""
    sigma_mm: float
    """Of the ball that is known worst, along the line of sight."""

    @property
    def warning(self) -> str | None:
        """What to say of a scan that lies in the table; None where it may stand on it, or higher."""
        if self.lowest_mm > -DEEP * self.sigma_mm:
            return None
        return (
            f"scan: its lowest point lies {-self.lowest_mm:.1f} mm under the table that the balls stand on, which they "
            f"tell to {self.sigma_mm:.1f} mm. The scan is too large (scan_unit), or diameter_mm of the balls is too "
            "small, or the balls stand higher than the object does. Normals hardly depend on it; lengths do."
        )


def on_table(mesh: Mesh, pose: Pose, spheres: list[Sphere], camera: Camera) -> OnTable | None:
    """Return where a scan at a pose (camera_from_scan) lies above the table; None where the balls do not tell it.

    Three balls, on stands perhaps, touch some plane. That a fourth touches it, too, says that it is the table.
    """
    standing = [one for one in spheres if one.diameter_mm and not one.apart]
    table = table_under(standing, camera)
    if table is None or len(standing) < 4:
        return None
    normal, offset = table
    sigma = max(-float(one.center_mm(camera)[2]) * one.sigma_px / one.radius_px for one in standing)
    if any(abs(normal @ one.center_mm(camera) - offset - one.radius_mm) > DEEP * sigma for one in standing):
        return None
    return OnTable(float((pose.apply(mesh.vertices) @ normal).min()) - offset, sigma)
