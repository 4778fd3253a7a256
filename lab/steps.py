"""The verbs: each reads what the steps before it wrote, calls one room, and writes its files."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from capture.audit.part_movement import part_warnings
from capture.camera.colour_chart import camera_colours
from capture.camera.session_camera import camera_of
from capture.photographs.decode import decode
from capture.session.requests import object_box, read_mask, sphere_requests
from lab.job import Job, Outcome
from lab.progress import progress_bar
from scene.camera import Camera
from scene.errors import AlignError, CalibrationError, SceneError, SessionError
from scene.files import move, write_json, write_npy
from scene.lights import Lights, check_count, known_median
from scene.method_names import METHODS
from scene.spheres import Sphere
from scene.store import Store


def check(job: Job) -> Outcome:
    """Decode the frames and audit the capture."""
    with progress_bar("decode") as progress:
        frames, report = decode(job.session, job.store, executor=job.executor, progress=progress)
    colour, colour_warnings = camera_colours(job.session, frames)
    camera, camera_warnings = camera_of(job.session, report.exif, frames.width, frames.height)
    _check_scale(job, camera)
    job.store.save_camera(camera)
    # As it was before the balls had their say: `calibrate` starts from this one.
    Store(job.store.path("frames")).save_camera(camera)
    result = {
        "frames": len(frames),
        "width": frames.width,
        "height": frames.height,
        "ambient": frames.ambient is not None,
        "frames_table": report.frames_table,
        "colour": colour,
    }
    return Outcome(result, [*report.warnings, *camera_warnings, *colour_warnings])


def _check_scale(job: Job, camera: Camera) -> None:
    if job.session.scan and not job.session.normals and camera.source == "assumed" and camera.is_orthographic:
        raise SessionError(
            f"{job.session.scan.name}: a scan in millimetres cannot be registered to frames of an unknown camera (no "
            "[camera] in session.toml, no focal length in EXIF, and the balls do not tell it). Add [camera] with "
            "focal_mm and sensor_mm, or shots of a ChArUco board or a chessboard, or leave object.scan out."
        )


def calibrate(job: Job) -> Outcome:
    """Find the balls and the lights."""
    from calibrate.calibrate import calibrate as find_lights
    from calibrate.calibration import Calibration, unknown_lights
    from calibrate.detection.balls import NoProbeError
    from calibrate.known_lights.read_known import read_lights
    from calibrate.unknown_focal import with_unknown_focal

    store = job.store
    frames, camera = store.load_frames(), Store(store.path("frames")).load_camera()
    session = job.session
    if session.normals or not session.scan:
        check_count(len(frames))
    skipped = tuple(set(range(session.photographed)) - set(session.kept))
    file = session.lights_file
    known = read_lights(file, frames.names, skipped=skipped, camera=camera) if file else None
    requests, ball_warnings = sphere_requests(session, store, executor=job.executor)
    try:
        if session.no_spheres and known is None:
            raise NoProbeError("spheres: session.toml says that there is none.")
        with progress_bar("calibrate") as progress:

            def run(camera: Camera) -> Calibration:
                return find_lights(frames, camera, requests, known_lights=known, progress=progress)

            is_unknown = camera.source == "assumed" and not camera.is_orthographic
            found = with_unknown_focal(run, camera) if is_unknown else run(camera)
    except CalibrationError as error:
        # Balls that were asked for must be there.
        if requests or known or not isinstance(error, NoProbeError):
            raise
        found = unknown_lights(frames, str(error), is_registered=bool(session.scan and not session.normals))
    camera = found.camera or camera
    _check_scale(job, camera)
    store.save_camera(camera)
    store.save_spheres(found.spheres, camera)
    store.save_lights(found.lights, files=job.frame_files)
    # As they are before they are moved to the object: `align` starts from these, however often it is run.
    Store(store.path("frames")).save_lights_json(found.lights)
    kept = ("highlights_px", "rejected", "position_covariance_mm2", "evidence", "warnings")
    write_json(store.path("calibration.json"), {name: getattr(found, name) for name in kept})
    lights = found.lights
    result = {
        "model": lights.model,
        "evidence": found.evidence,
        "spheres": len(found.spheres),
        "direction_sigma_deg_median": known_median(lights.direction_sigma_deg),
        "intensity_sigma_median": known_median(lights.intensity_sigma),
        "cross_validation": None if found.cross_validation is None else found.cross_validation._asdict(),
        "white_ball_deg": found.white_ball_deg,
    }
    return Outcome(result, [*ball_warnings, *found.warnings])


def align(job: Job) -> Outcome:
    """Find the object; register the scan; write the ground truth."""
    from align.mask.object_mask import find_object
    from align.truth import read_normals
    from lab.registration import register_scan
    from solve.axes import lights_in_other_axes

    store, session = job.store, job.session
    frames, camera, lights = store.load_frames(), store.load_camera(), Store(store.path("frames")).load_lights()
    spheres = store.load_spheres()
    given = read_mask(session.mask, frames.height, frames.width) if session.mask else None
    found = find_object(frames, camera, spheres, mask_given=given, box=object_box(session, frames.width))
    lights = lights.seen_from(_object_point(camera, spheres, lights, found.mask))
    warnings, result = [*found.warnings, *part_warnings(frames, spheres)], None
    if session.lights_file and not spheres:
        told = lights_in_other_axes(frames, lights, camera, found.mask)
        warnings += [told] if told else []
    if session.scan and not session.normals:
        try:
            result, more = register_scan(job, frames, camera, lights, found)
        except AlignError as error:
            # Under wrong lights or a wrong mask no scan fits: what was said of them comes first.
            said = [*job.done["calibrate"]["warnings"], *warnings]
            doubts = [text for text in said if text.startswith(("lights.file", "mask:"))]
            raise AlignError("\n".join([*doubts, str(error)])) from error
        return Outcome({"truth": result}, warnings + more)
    if session.normals:
        normals = read_normals(session.normals, frames.height, frames.width)
        store.save_truth(np.where(found.mask[..., None], normals, np.nan), np.full(found.mask.shape, np.nan))
        result = {"evidence": [f"ground truth given: {session.normals.name}"]}
        if session.scan:
            warnings.append("object.normals is given: the scan is not registered, and there is no twin.")
    else:
        warnings.append(
            "No scan and no given normals: there is no ground truth, so no error, no twin and no verdict on the "
            'methods. Add [object] scan = "..." to session.toml.'
        )
    store.save_mask(found.mask)
    store.save_lights(lights, files=job.frame_files)
    return Outcome({"truth": result}, warnings)


def solve(job: Job) -> Outcome:
    """Recover normals and albedo by every method asked for."""
    from solve.frames_at_odds import at_odds

    result, warnings, lights = solve_all(job, job.store, "solve", job.methods)
    store, warned = job.store, any(job.done.get(step, {}).get("warnings") for step in ("check", "calibrate"))
    given = store.load_frames(), lights, store.load_camera(), store.load_mask()
    metal, said = at_odds(*given, warned=warned)
    if metal is not None:
        do = "Look at its sigma." if "metal" in job.methods else "Ask for --method metal."
        told = (
            f"the object mirrors the flashes as a metal does (roughness {metal.alpha**0.5:.2f}): all methods but "
            f"metal suppose a matte object, and are wrong by tens of degrees. {do}"
        )
        # What our other methods doubt is what a metal does to them.
        others = tuple(f"{name}:" for name in METHODS if name != "metal")
        return Outcome(result, [told, *(text for text in warnings if not text.startswith(others))])
    return Outcome(result, said + warnings)


def solve_all(job: Job, store: Store, label: str, methods: Sequence[str]) -> tuple[dict, list[str], Lights]:
    """Run methods on a store's frames, and save what each finds there; return the lights that they were given, too."""
    from solve.frame_intensities import corrected
    from solve.given_normals import solve_external
    from solve.solve import solve as run

    frames, camera, mask = store.load_frames(), job.store.load_camera(), job.store.load_mask()
    lights, warnings = corrected(frames, job.store.load_lights(), camera, mask)
    table = {}
    megapixels = int(mask.sum()) / 1e6
    for method in methods:
        with progress_bar(f"{label}: {method}") as progress:
            how = {"executor": job.executor, "progress": progress}
            if method in job.externals:
                # Unfinished, and so nobody's, until it has ended well: the program writes there too.
                folder = job.record.scratch("external") / label / method
                estimate = solve_external(job.externals[method], frames, lights, camera, mask, folder, **how)
                move(folder, store.path("external", method))
            else:
                estimate = run(method, frames, lights, camera, mask, profile=job.profile, **how)
        store.save_estimate(estimate)
        own = ("seconds", "processor_seconds", "settings", "warnings")
        table[method] = {name: getattr(estimate, name) for name in own} | {
            "megapixels": megapixels,
            "frames": len(frames),
            "processor_seconds_per_megapixel_image": estimate.processor_seconds / (megapixels * len(frames)),
            "sigma_deg_median": known_median(estimate.sigma_deg),
            "profile": job.profile,
        }
        if estimate.lights is not None:
            found = estimate.lights.seen_from(lights.reference_point_mm)
            table[method] |= {"intensities": found.intensities, "intensity_sigma": found.intensity_sigma}
        warnings += [f"{method}: {text}" for text in estimate.warnings]
        # The next method's maps need its place.
        del estimate
    return {"methods": table}, warnings, lights


def trust(job: Job) -> Outcome:
    """Find which method predicts frames best that it is not given, and how far the others are from it."""
    from solve.frame_intensities import corrected
    from solve.trust import trust as judge

    store = job.store
    frames, camera, mask = store.load_frames(), store.load_camera(), store.load_mask()
    lights, _ = corrected(frames, store.load_lights(), camera, mask)
    answers = {name: store.read_array("normals", f"{name}.npy") for name in job.methods}
    try:
        found = judge(frames, lights, camera, mask, answers, profile=job.profile)
    except SceneError as error:
        return Outcome({}, [str(error)])
    write_npy(store.path("sigma", "recommended.npy"), found.sigma_deg)
    known = found.sigma_deg[np.isfinite(found.sigma_deg)]
    median, most = np.quantile(known, [0.5, 0.9]).tolist() if len(known) else (None, None)
    result = {name: getattr(found, name) for name in ("recommended", "level", "relative_rmse", "doubts")} | {
        "sigma_deg": {"median": median, "q90": most},
        "methods": {name: row._asdict() for name, row in found.methods.items()},
    }
    return Outcome(result, list(found.doubts))


def compare(job: Job) -> Outcome:
    """Compare every method with the truth, real and twin."""
    from compare.compare import compare as judge
    from compare.statistics.known_truth import known_truth

    said = list(job.tolerances_deg.values())
    result = judge(job.store, methods=job.methods, tolerance_deg=job.tolerance_deg)
    if len(set(said)) > 1:
        result["warnings"].append(
            f"tolerance: {said[0]:g} degrees were said by --tolerance, which goes before the {said[1]:g} of "
            "object.tolerance_deg in session.toml. To judge by these give --tolerance none."
        )
    if job.settings.truth:
        mesh = job.load_scan() if job.session.scan else None
        result["truth_check"] = known_truth(job.store, job.settings.truth, methods=job.methods, mesh=mesh)
    return Outcome(result, list(result.get("warnings", ())))


def _object_point(camera: Camera, spheres: list[Sphere], lights: Lights, mask: Any) -> Any:
    """Return the object's centre as far as it is known without a scan: mid mask, at the balls' mean depth."""
    rows, columns = np.nonzero(mask)
    pixel = np.array([columns.mean(), rows.mean()])
    depths = [sphere.center_mm(camera)[2] for sphere in spheres if sphere.diameter_mm and not camera.is_orthographic]
    depth = float(np.mean(depths)) if depths else float(lights.reference_point_mm[2])
    return camera.points_at_depth(pixel, depth) if depth < 0 or camera.is_orthographic else lights.reference_point_mm
