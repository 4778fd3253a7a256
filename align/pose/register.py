"""The scan's place in front of the camera, found without clicks and refined on every frame."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from align.pose.fit import Fit, fit_of
from align.pose.photographed import Photographs
from align.pose.search import FINALISTS, SURE, Found, search
from align.pose.unknown_lengths import LongerFocal, free_scale, register_longer
from align.scan.smooth_normals import smooth_normals
from scene.errors import AlignError
from scene.mesh import Mesh
from scene.pose import Pose
from scene.rays import RayCaster

Array = NDArray[np.float64]

WORST_MISFIT = 1.0
"""Above it the scan is refused."""
MIRROR_MISFIT = 0.6
"""Above it the mirrored scan is tried."""
MIRRORED = 0.75
"""Of its normals' angle, what a mirrored scan must fit better by to be the right one."""
POOR_MISFIT = 0.95
"""Above it the pose is doubted."""
DOUBTED = 1.5
"""Ratio of the scan's distance to the balls' from which lengths are doubted where the scan does not fit."""
UNITS = {10.0: "cm and mm", 25.4: "inch and mm", 1000.0: "m and mm", 100.0: "m and cm", 2.54: "inch and cm"}
"""Between two units of length: the ratio of each pair that people exchange."""


@dataclass(frozen=True)
class Registration:
    """Where the scan stands, and how well that is known."""

    pose: Pose
    """camera_from_scan, mm."""
    residual_px: float
    """Rms distance between the scan's outline and the edge in the photographs, inliers, after their common offset
    (`edge_bias_px` in the evidence: an object darkens toward its blurred outline, and looks a fraction of a pixel
    smaller)."""
    sigma_mm: float
    sigma_deg: float
    """sigma_mm, sigma_deg: standard deviation (rms length) of the position of the scan's middle, and of the rotation.
    An orthographic camera does not tell depth: it is left out there."""
    covariance: Array
    """(6, 6): of the twist (rotation vector in radians about the scan's middle, translation in mm), camera axes, see
    `align.pose.motion.nudge`. Where the focal length is not known, its part (`longer`) is in it and in both sigmas."""
    evidence: dict[str, float]
    """overlap (intersection over union of silhouette and mask), normals_deg (median angle to the normals that fit the
    photographs best), beside_deg (the same of the scan turned a little), outline_share (of the outline within a pixel
    of an edge), misfit (these as one number, see `Fit`), shading (relative residual), rim_points, edge_bias_px,
    disagreement (of outline and shading: the variance is inflated by it); under near lights scale, scale_sigma (see
    `free_scale`); of the best pose and the next, where there is one: cost, second_cost, second_deviations (see
    `compare_poses`), second_angle_deg; where the focal length is not known: focal_sigma (relative), and
    focal_shift_mm (of the pose, over one sigma of it)."""
    warnings: tuple[str, ...] = ()
    longer: LongerFocal | None = None
    """The same with a focal length one sigma longer; None where the focal length is known."""

    def with_covariance(self, covariance: Array) -> "Registration":
        """Return the same of another covariance (6, 6) but for the focal length's part, and of the sigmas it makes."""
        whole = covariance if self.longer is None else covariance + self.longer.covariance
        shift, turn = np.sqrt(np.trace(whole[3:, 3:])), np.degrees(np.sqrt(np.trace(whole[:3, :3])))
        return replace(self, covariance=whole, sigma_mm=float(shift), sigma_deg=float(turn))


def register(
    mesh: Mesh,
    photographs: Photographs,
    normals: NDArray,
    *,
    start: Pose | None = None,
    at_vertices: NDArray | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Registration:
    """Find the pose of a scan, from any orientation, and refine it on all frames.

    Every orientation is tried on silhouette and normals (`align.pose.start`); the best are rated and refined by mask
    and shading at low resolution (`align.pose.search`), the last few on the outline in the photographs and on the
    shading of all frames (`align.pose.full_resolution`), whatever the material (`align.pose.appearance`). A hypothesis
    test chooses (`align.pose.search.compare_poses`).

    Parameters
    ----------
    mesh : Mesh
        The scan, mm.
    photographs : Photographs
        Frames, camera, lights and the object's mask.
    normals : (H, W, 3) float
        Photometric-stereo normals, camera frame, NaN where unknown; may be many degrees off.
    start : Pose, optional
        camera_from_scan, some pixels off: it is refined, and no other is looked for.
    at_vertices : (V, 3) float, optional
        The scan's normals without its noise, where they are known already; see `align.scan.smooth_normals`.
    executor : Executor, optional
        Runs the starts side by side.
    progress : callable, optional
        Called with (done, total).

    Raises
    ------
    AlignError
        The mask is empty, or the scan does not fit: another object, a mirrored scan, a wrong unit.
    """
    photographs.check(normals)
    caster = RayCaster(mesh, smooth_normals(mesh)[0] if at_vertices is None else at_vertices)
    found = search(caster, photographs, normals, start=start, executor=executor, progress=progress)
    evidence, pose = found.evidence, found.evidence.pose
    distance = -float(pose.apply(mesh.center_mm)[2])
    _check_distance(photographs, distance)
    fit = fit_of(evidence)
    facts = {
        "overlap": fit.overlap,
        "normals_deg": fit.normals_deg,
        "beside_deg": fit.beside_deg,
        "outline_share": fit.outline_share,
        "misfit": fit.misfit,
        "shading": evidence.shading_sigma,
        "rim_points": float(len(evidence.edges.pixels)),
        "edge_bias_px": evidence.edges.bias_px,
        "disagreement": evidence.weighed.disagreement,
    }
    warnings = []
    if fit.misfit > MIRROR_MISFIT:
        _refuse_mirrored(caster, fit, lambda mirrored: search(mirrored, photographs, normals, most=FINALISTS))
    if fit.misfit > WORST_MISFIT:
        raise AlignError(
            f"scan: it does not fit the photographs: {fit.words}. Is it the scan of this object, whole on the "
            f"side that the camera sees, and is the mask on the object?{_doubted_lengths(photographs, distance)}"
            f"{photographs.cut_words}"
        )
    if fit.misfit > POOR_MISFIT:
        warnings.append(f"scan: it fits poorly: {fit.words}. Check the silhouette in the report.")
    if found.second is not None and found.test is not None:
        facts["cost"], facts["second_cost"] = found.test.costs
        facts["second_deviations"] = found.test.deviations
        facts["second_angle_deg"] = (pose.inverse() @ found.second).angle_deg()
        if found.test.deviations < SURE:
            warnings.append(
                f"scan: two poses fit nearly as well (cost {facts['cost']:.4f} and {facts['second_cost']:.4f}, "
                f"{facts['second_deviations']:.1f} standard deviations), {facts['second_angle_deg']:.0f} degrees "
                "apart: the object looks nearly symmetric. Check the silhouette and the shading in the report."
            )
    bias_px = evidence.edges.bias_px
    if abs(bias_px) > 1:
        warnings.append(
            f"scan: its outline lies {abs(bias_px):.1f} px {'outside' if bias_px > 0 else 'inside'} "
            "the edges in the photographs all round; expected a fraction of a pixel. Is the scan's unit, or the "
            "camera's focal length, a little off?"
        )
    free = free_scale(evidence)
    if free is not None:
        facts["scale"], facts["scale_sigma"] = free.scale, free.sigma
        doubted = _doubted_lengths(photographs, distance)
        # What surroundings may send back can make up for lights that are far off, but not for both.
        if free.warning and doubted:
            raise AlignError(free.warning + doubted)
        warnings += [free.warning] if free.warning else []
    longer = register_longer(evidence)
    if longer is not None:
        facts["focal_sigma"] = photographs.camera.focal_sigma
        facts["focal_shift_mm"] = float(np.linalg.norm(longer.twist[3:]))
    return Registration(
        pose,
        evidence.edges.residual_px,
        0.0,
        0.0,
        np.zeros((6, 6)),
        facts,
        tuple(warnings),
        longer,
    ).with_covariance(evidence.covariance())


def _check_distance(photographs: Photographs, distance: float) -> None:
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


def _doubted_lengths(photographs: Photographs, distance: float) -> str:
    """Say where a scan that does not fit, or not by its size, stands much nearer or farther than the balls."""
    expected = -float(photographs.lights.reference_point_mm[2])
    if photographs.camera.is_orthographic or expected <= 0 or 1 / DOUBTED < distance / expected < DOUBTED:
        return ""
    return (
        f" It stands {distance / expected:.2g} times as far from the camera as the balls do by diameter_mm: check "
        "scan_unit, and that diameter_mm is the diameter in millimetres, not the radius."
    )


def _refuse_mirrored(caster: RayCaster, fit: Fit, search_for: Callable[[RayCaster], Found]) -> None:
    mesh, mirror = caster.mesh, np.array([-1.0, 1.0, 1.0])
    flipped = replace(mesh, vertices=mesh.vertices * mirror, faces=mesh.faces[:, [0, 2, 1]])
    mirrored = fit_of(search_for(RayCaster(flipped, caster.normals * mirror)).evidence)
    # A scan that is its own mirror image may have stopped beside its best pose: its normals fit as well as mirrored.
    # Half a scan, or another object's, may fit better mirrored, and still not fit.
    if mirrored.normals_deg < MIRRORED * fit.normals_deg and mirrored.misfit < min(fit.misfit, WORST_MISFIT):
        raise AlignError(
            f"scan: it fits mirrored only: {fit.words}; of its mirror image, {mirrored.words}. One axis of the scan "
            "is reversed: export it again from the scanner's program, or negate one coordinate."
        )


def register_unknown_scale(
    mesh: Mesh,
    photographs: Photographs,
    register: Callable[[Mesh, Pose | None], Registration],
    *,
    start: Pose | None = None,
) -> tuple[Mesh, Registration, float]:
    """Register a scan whose unit is not known: its scale comes out of the registration.

    A camera alone cannot tell a small object nearby from a large one far off. The lights were calibrated about a point
    at a known distance, though, where the balls stand and the object with them: that distance is the scale.

    `mesh` and `start`, camera_from_scan as picks give it, are in the file's unit; `register` takes a mesh in mm, and a
    start or None. Return the mesh in mm, its
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
