"""Whether the scan's mirror image explains the photographs better: one of its axes was reversed on export."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from align.pose.fit import WORST_MISFIT, Fit, fit_of
from align.pose.full_resolution import FinalEvidence
from align.pose.search import SURE, Found, compare_poses
from scene.errors import AlignError
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.pose import Pose
from scene.rays import RayCaster

MIRROR_MISFIT = 0.4
"""Above it the mirrored scan is sought all around. Right scans of matte objects have 0.2 to 0.4, of metals 0.6.
Mirrored scans of nearly symmetric objects had 0.2 to 0.55: below it, the plane of symmetry tells where to look."""
MIRROR_REACH_PX = 10.0
"""How far from the outline of the mirrored scan, laid by that plane, its edges are looked for."""
MIRRORED = 0.75
"""Of its normals' angle, what a mirrored scan must fit better by to be the right one."""


def refuse_mirrored(evidence: FinalEvidence, fit: Fit, search_for: Callable[[RayCaster], Found]) -> str | None:
    """Raise AlignError where the scan fits mirrored only; return what to say where it fits as well or better so."""
    caster, mirror = evidence.seen.caster, np.array([-1.0, 1.0, 1.0])
    mesh = caster.mesh
    flipped = replace(mesh, vertices=mesh.vertices * mirror, faces=mesh.faces[:, [0, 2, 1]])
    image = RayCaster(flipped, caster.normals * mirror)
    seen = replace(evidence.seen, caster=image)
    if fit.misfit <= MIRROR_MISFIT:
        laid = FinalEvidence(seen, evidence.pose @ onto_mirror_image(mesh), MIRROR_REACH_PX).refined(rounds=3)
        better = compare_poses(laid, evidence)
        if better < SURE:
            return _as_well(laid, evidence, better)
    other = search_for(image).evidence
    mirrored = fit_of(other)
    # Half a scan, or another object's, may fit better mirrored, and still not fit.
    if mirrored.misfit >= min(fit.misfit, WORST_MISFIT):
        return None
    # A scan that is its own mirror image may have stopped beside its best pose: its normals fit as well as mirrored.
    if mirrored.normals_deg < MIRRORED * fit.normals_deg:
        raise AlignError(
            f"scan: it fits mirrored only: {fit.words}; of its mirror image, {mirrored.words}. One axis of the scan "
            "is reversed: export it again from the scanner's program, or negate one coordinate."
        )
    # Nearly its own mirror image: both fit, and the same pixels are asked which one they show.
    other = replace(other, seen=seen)
    better = compare_poses(other, evidence)
    if better < SURE:
        return _as_well(other, evidence, better)
    return (
        f"scan: its mirror image fits better, by {better:.1f} standard deviations (its normals are "
        f"{mirrored.normals_deg:.1f} degrees from what the photographs show, the scan's {fit.normals_deg:.1f}). Is one "
        "axis of the scan reversed? Export it again from the scanner's program, or negate one coordinate, and compare."
    )


def _as_well(other: FinalEvidence, evidence: FinalEvidence, better: float) -> str | None:
    """Return what to say where scan and mirror image explain the same pixels equally well, and are not the same."""
    turned = float(np.nanmedian(angular_error_deg(other.surface[1], evidence.surface[1])))
    doubt = float(np.degrees(np.sqrt(np.trace(evidence.covariance()[:3, :3]))))
    if better < -SURE or turned < 2 * doubt:
        return None
    return (
        f"scan: its mirror image fits as well ({abs(better):.1f} standard deviations apart), and with it the true "
        f"normals would be {turned:.2g} degrees (median) others: the photographs do not tell whether one axis of the "
        "scan is reversed. Look at the scan in the scanner's program."
    )


def onto_mirror_image(mesh: Mesh) -> Pose:
    """Return scan_from_mirrored: the motion that lays the mirror image (its x negated) onto the scan as well as it can.

    A plane of symmetry is normal to a principal axis of the surface: mirrored at each, then by iterated closest points.
    """
    import trimesh

    points = trimesh.sample.sample_surface(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False), 5000, seed=0)[0]
    middle, mirror = points.mean(0), np.diag([-1.0, 1.0, 1.0])
    laid = []
    for axis in np.linalg.svd(points - middle, full_matrices=False)[2]:
        turn = (np.eye(3) - 2 * np.outer(axis, axis)) @ mirror
        onto = Pose.from_rotation_translation(turn, middle - turn @ mirror @ middle)
        laid.append(trimesh.registration.icp(points[::5] @ mirror, points, onto.matrix, reflection=False, scale=False))
    return Pose(min(laid, key=lambda one: one[2])[0])
