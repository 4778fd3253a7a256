"""The scale of a scan: whether the one that is given may be right, or what it is where none is.

The picture does not tell it, as a larger object farther away looks the same. But the lights stand in the millimetres of
the balls' diameters.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from align.pose.photographed import Photographs
from scene.errors import AlignError
from scene.mesh import Mesh
from scene.pose import Pose

Array = NDArray[np.float64]

DOUBTED = 1.5
"""Ratio of the scan's distance to the balls' from which lengths are doubted where the scan does not fit."""
UNITS = {10.0: "cm and mm", 25.4: "inch and mm", 1000.0: "m and mm", 100.0: "m and cm", 2.54: "inch and cm"}
"""Between two units of length: the ratio of each pair that people exchange."""


def register_unknown_scale(
    mesh: Mesh,
    photographs: Photographs,
    register: Callable[[Mesh, Pose | None], Any],
    *,
    start: Pose | None = None,
) -> tuple[Mesh, Any, float]:
    """Register a scan whose unit is not known: its scale comes out of the registration.

    A camera alone cannot tell a small object nearby from a large one far off. The lights were calibrated about a point
    at a known distance, though, where the balls stand and the object with them: that distance is the scale, unless
    shadows tell it better (`align.pose.cast_shadows`).

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
    else:
        scale = distance / -float(start.apply(mesh.center_mm)[2])
    first = register(_scaled(mesh, scale), start and scaled_pose(start, scale))
    middle = first.pose.apply(scale * mesh.center_mm)
    shadow = first.evidence.get("shadow_scale")
    nearer = distance / -float(middle[2]) if shadow is None else shadow
    scale *= nearer
    found = register(_scaled(mesh, scale), scaled_pose(first.pose, nearer))
    said = (
        f"scan_unit is unknown: 1 unit of the scan's file was taken for {scale:.4g} mm, "
        + (
            f"which puts the object at the distance that the lights were calibrated about, {distance:.4g} mm"
            if shadow is None
            else "as its shadow on the table and the balls' shadows tell"
        )
        + ". Normals hardly depend on it; lengths do."
    )
    return _scaled(mesh, scale), replace(found, warnings=(*found.warnings, said)), scale


def scaled_pose(pose: Pose, scale: float) -> Pose:
    """Return camera_from_scan when all lengths are multiplied by `scale`."""
    return Pose.from_rotation_translation(pose.rotation, scale * pose.translation)


def _scaled(mesh: Mesh, scale: float) -> Mesh:
    return replace(mesh, vertices=scale * mesh.vertices)


def check_distance(photographs: Photographs, distance: float) -> None:
    """Raise AlignError where a scan stands so much nearer or farther, mm, than the lights that a unit must be wrong."""
    expected = -float(photographs.lights.reference_point_mm[2])
    if not photographs.camera.is_orthographic and expected > 0 and not 0.4 < distance / expected < 2.5:
        large, small = ("large", "small") if distance > expected else ("small", "large")
        times = max(distance / expected, expected / distance)
        meant = next((f" ({pair} exchanged?)" for factor, pair in UNITS.items() if 0.9 < times / factor < 1.1), "")
        raise AlignError(
            f"scan: about {times:,.1f} times too {large}{meant}, or diameter_mm of the balls so much too {small}: "
            f"it would have to stand {distance:,.1f} mm from the camera to look as large as the object, but the lights "
            f"were calibrated about a point {expected:,.1f} mm away. Check scan_unit under [object], and [[spheres]]."
            f"{photographs.cut_words}"
        )


def doubted_lengths(photographs: Photographs, distance: float) -> str:
    """Say where a scan that does not fit, or not by its size, stands much nearer or farther than the balls."""
    expected = -float(photographs.lights.reference_point_mm[2])
    if photographs.camera.is_orthographic or expected <= 0 or 1 / DOUBTED < distance / expected < DOUBTED:
        return ""
    return (
        f" It stands {distance / expected:.2g} times as far from the camera as the balls do by diameter_mm: check "
        "scan_unit, and that diameter_mm is the diameter in millimetres, not the radius."
    )
