"""The scale of a scan: whether the one that a finished registration was given is right, or what it is.

The picture does not tell it, as a larger object farther away looks the same. But near lights reach it otherwise there,
and where they stand is known in the millimetres of the balls' diameters.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from align.pose.full_resolution import UNMODELLED, FinalEvidence
from align.pose.motion import Term
from align.pose.photographed import Photographs
from scene.errors import AlignError
from scene.mesh import Mesh
from scene.pose import Pose

Array = NDArray[np.float64]

SCALE_ROUNDS = 4
"""Of the refinement; it starts within a pixel."""
STEP = 0.02
"""Of log scale, for its slope."""
SUSPICIOUS, DEVIATIONS = 0.04, 4.0
"""How far from 1 a scale must be, and by how many of its sigmas, for a word. Sound sessions stay within 0.02."""


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
    return replace(term, jacobian=np.column_stack([term.jacobian, more]))


def register_unknown_scale(
    mesh: Mesh,
    photographs: Photographs,
    register: Callable[[Mesh, Pose | None], Any],
    *,
    start: Pose | None = None,
) -> tuple[Mesh, Any, float]:
    """Register a scan whose unit is not known: its scale comes out of the registration.

    A camera alone cannot tell a small object nearby from a large one far off. The lights were calibrated about a point
    at a known distance, though, where the balls stand and the object with them: that distance is the scale.

    `mesh` and `start`, camera_from_scan as picks give it, are in the file's unit; `register` takes a mesh in mm, and a
    start or None, and gives a `Registration`. Return the mesh in mm, its registration, and the millimetres of one unit.

    Raises
    ------
    AlignError
        The camera is orthographic: it does not tell distance.
    """
    camera = photographs.camera
    if camera.is_orthographic:
        raise AlignError(
            "scan_unit: it is unknown, and an orthographic camera does not tell the scale. Give scan_unit, or a ball "
            "in the scan: scan_ball_diameter_mm under [object]."
        )
    distance = -float(photographs.lights.reference_point_mm[2])
    if start is None:
        rows, columns = np.nonzero(photographs.mask)
        extent_px = float(np.hypot(np.ptp(rows), np.ptp(columns)))
        # Near enough to look for the pose: the mask's diagonal is about the scan's diameter.
        scale = distance * extent_px / camera.fx / (2 * mesh.radius_mm)
        first = register(_scaled(mesh, scale), None)
    else:
        scale = distance / -float(start.apply(mesh.center_mm)[2])
        first = register(_scaled(mesh, scale), scaled_pose(start, scale))
    middle = first.pose.apply(scale * mesh.center_mm)
    nearer = distance / -float(middle[2])
    scale *= nearer
    found = register(_scaled(mesh, scale), scaled_pose(first.pose, nearer))
    said = (
        f"scan_unit is unknown: 1 unit of the scan's file was taken for {scale:.4g} mm, which puts the object at the "
        f"distance that the lights were calibrated about, {distance:.4g} mm. Normals hardly depend on it; lengths do."
    )
    return _scaled(mesh, scale), replace(found, warnings=(*found.warnings, said)), scale


def scaled_pose(pose: Pose, scale: float) -> Pose:
    """Return camera_from_scan when all lengths are multiplied by `scale`."""
    return Pose.from_rotation_translation(pose.rotation, scale * pose.translation)


def _scaled(mesh: Mesh, scale: float) -> Mesh:
    return Mesh(scale * mesh.vertices, mesh.faces, mesh.repairs)
