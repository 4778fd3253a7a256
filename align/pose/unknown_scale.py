"""A scan without a unit: its scale comes out of the registration.

A camera alone cannot tell a small object nearby from a large one far off. The lights were calibrated about a point at a
known distance, though, where the balls stand and the object with them: that distance is the scale.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from align.pose.photographed import Photographs
from align.pose.register import Registration
from scene.errors import AlignError
from scene.mesh import Mesh
from scene.pose import Pose

Register = Callable[[Mesh, Pose | None], Registration]


def register_unknown_scale(
    mesh: Mesh, photographs: Photographs, register: Register, *, start: Pose | None = None
) -> tuple[Mesh, Registration, float]:
    """Register a scan whose unit is not known.

    `mesh` and `start`, camera_from_scan as picks give it, are in the file's unit; `register` takes a mesh in mm, and a
    start or None. The lights are calibrated about a point at the object's distance. Return the mesh in mm, its
    registration, and the millimetres of one unit.

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
