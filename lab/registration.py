"""The scan's part of the step `align`: registered, its ground truth and pictures written."""

from dataclasses import replace
from typing import Any

import numpy as np

from align.light_probe.from_scan import lights_from_scan
from align.mask.scan_mask import scan_mask
from align.pose.motion import apart_px
from align.pose.photographed import Photographs, shading_tells, thinned
from align.pose.picks import read_picks
from align.pose.register import Registration, register
from align.pose.scan_scale import register_unknown_scale, scaled_pose
from align.pose.scan_view import outline_strokes
from align.scan.smooth_normals import smooth_normals
from align.truth import ground_truth
from capture.session.requests import hint_scale
from compare.report.registration_pictures import write_pictures
from lab.job import Job, scale_unknown
from lab.progress import progress_bar
from scene.camera import Camera
from scene.errors import AlignError
from scene.frames import Frames
from scene.length_units import UNITS_MM
from scene.lights import Lights, known_median
from scene.mesh import Mesh
from scene.pose import Pose
from scene.rays import RayCaster
from solve.solve import solve


def register_scan(job: Job, frames: Frames, camera: Camera, lights: Lights, rough_mask: Any) -> tuple[dict, list[str]]:
    """Register the scan and write pose, truth, mask and lights."""
    store = job.store
    if lights.is_unknown and scale_unknown(job.session):
        raise AlignError(
            "scan_unit: it is unknown, and no ball is there to tell the scale of scan and lights. Give scan_unit, or "
            "a ball in the scan: scan_ball_diameter_mm under [object]."
        )
    mesh = job.load_scan()
    picked, picks, smooth = None, job.session.picks, smooth_normals(mesh)
    if picks is not None:
        half = hint_scale(job.session, camera.width) == 2
        picked = read_picks(picks, camera, mesh, unit=job.session.scan_unit, half=half)
    start, probe = picked.pose if picked else None, None
    doubts = []
    if lights.is_unknown:
        try:
            photographs = Photographs(camera, frames, lights, rough_mask.mask)
            with progress_bar("lights by the scan") as progress:
                how = {"start": start, "executor": job.executor, "progress": progress}
                probe = lights_from_scan(RayCaster(mesh, smooth[0]), smooth[1], photographs, **how)
            lights, start, doubts = probe.lights, probe.pose, list(probe.warnings)
        except AlignError as error:
            # No light is told; where the outline is may be.
            doubts.append(str(error))
    mask, scale = rough_mask.mask, None
    photographs = Photographs(camera, frames, lights, mask, tuple(store.load_spheres()))
    normals = None
    if shading_tells(lights):
        normals = solve("iterative", frames, lights, camera, thinned(mask), executor=job.executor).normals
    with progress_bar("register") as progress:

        def run(scan: Mesh, begin: Pose | None) -> Registration:
            how = {"at_vertices": smooth[0], "executor": job.executor, "progress": progress}
            return register(scan, photographs, normals, start=begin, **how)

        if scale_unknown(job.session):
            mesh, found, scale = register_unknown_scale(mesh, photographs, run, start=start)
        else:
            found = run(mesh, start)
    if probe:
        found = replace(found, covariance=probe.covariance)
    truth = ground_truth(mesh, found.pose, camera, covariance=found.covariance, at_vertices=smooth)
    store.save_truth(truth.normals, truth.sigma_deg)
    exactness = {name: getattr(found, name) for name in ("residual_px", "sigma_mm", "sigma_deg")}
    store.save_pose(found.pose, **exactness, mm_per_unit=scale)
    final_mask = scan_mask(truth.mask, rough_mask)
    store.save_mask(final_mask.mask)
    lights = lights.seen_from(found.pose.apply(mesh.center_mm))
    store.save_lights(lights, files=job.frame_files)
    strokes = outline_strokes(mesh, found.pose, camera)
    write_pictures(store, frames, lights, strokes=strokes, mask=final_mask.mask)
    result = {
        **exactness,
        "focal_px": None if camera.is_orthographic else camera.fx,
        "focal_sigma": camera.focal_sigma,
        "fit": found.evidence,
        "evidence": [*mesh.repairs, *([probe.evidence] if probe else [])],
        "size_mm": np.ptp(mesh.vertices, axis=0),
        "mm_per_unit": scale or (None if job.session.scan_unit == "unknown" else UNITS_MM[job.session.scan_unit]),
        "distance_mm": None if camera.is_orthographic else np.linalg.norm(found.pose.apply(mesh.center_mm)),
        "truth_sigma_deg_median": known_median(truth.sigma_deg),
        "light_probe": probe and probe.facts(),
    }
    warnings = [*found.warnings, *final_mask.warnings, *doubts]
    if picks is not None and picked is not None:
        away = apart_px(mesh, camera, scaled_pose(picked.pose, scale or 1.0), found.pose)
        result["picks"] = {"residual_px": picked.residual_px, "from_pose_px": away}
        warnings += picked.warnings
        # Some pixels of each pick's error, drawn out over the part of the scan that has none.
        if away > 10 + 0.02 * np.sqrt(final_mask.mask.sum()) + 5 * picked.residual_px:
            warnings.append(
                f"{picks.name}: the picks put the scan {away:.0f} px (rms) from where it was registered: "
                "one of the two is wrong. Check the outline in the report, and the picks."
            )
    return result, warnings
