"""`results/`: what was found, in files that other programs open: TIFF maps, the surface as PLY and GLB."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from compare.report.facts import best_method
from compare.report.pictures import PixelBox
from formats.meshes.scan_files import write_glb
from formats.picture_files import LUMINANCE, srgb_from_linear
from formats.tiff_files import write_map
from lab.job import Job, Outcome
from lab.options import GreenAxis
from scene.camera import Camera
from scene.files import write_json
from scene.lights import Lights
from scene.normals import encode_normals
from scene.store import Store

FOLDER = "results"
VERTICES = 1_000_000
"""Of the surface, about: what viewers still turn."""
TEXTURE_PX = 4096
"""Of the longer side of its picture, at most: browsers on telephones take no more."""
HEADROOM, MOST = 1.25, 0.999
"""White of an albedo map, in units of this quantile of the albedo: what glares beyond it is cut."""
NEUTRAL = 0.8, 1.25
"""Red and blue of a white ball, of its green: matte balls are yellowish by less."""


class Colours(NamedTuple):
    """The matrix (3, 3) of an albedo, which colours it makes, what a value of 1 is; source: "chart", "camera", None."""

    matrix: NDArray[np.float64]
    source: str | None
    colour: str
    one: str
    warnings: tuple[str, ...] = ()


def albedo_colours(job: Job) -> Colours:
    """Return how a session's albedo becomes colours.

    A chart's matrix M holds for its light: one that stood in a flash frame of intensity e (3,) gives M diag(e) for the
    albedo, which is under intensity 1; one that was photographed apart is taken to be lit as the frames on average.
    The camera's own matrix wants white to be known: it is the white ball's. The ball's luminance becomes its stated
    reflectance, or 1; without a ball the neutral colour of green value 1 has luminance 1.
    """
    lights, known = job.store.load_lights(), job.done.get("check", {}).get("result", {}).get("colour", {})
    ball, source = lights.white_value, known.get("source")
    own = np.array(known.get("camera_to_srgb") or np.eye(3), float)
    of_ball = "" if ball is None else ", white as the white ball"
    matrix = np.eye(3) if ball is None else np.diag(1 / ball)
    if source == "chart":
        flash, missed = known["flash"], known["delta_e_2000"]
        matrix = own if flash is None else own * np.nan_to_num(lights.intensities[flash], nan=1.0)
        missed = f"median {missed['median']:.1f}, worst {missed['worst']:.1f}"
        colour = f"linear sRGB (D65), by the ColorChecker; Delta E 2000 of its patches: {missed}"
    elif source == "camera" and ball is not None:
        matrix, colour = own @ matrix, f"linear sRGB (D65), by the camera's own matrix{of_ball}"
    else:
        source, colour = None, f"the camera's own RGB, linear{of_ball}"
    if ball is None:
        neutral = np.linalg.solve(matrix, np.ones(3))
        return Colours(matrix * neutral[1], source, colour, "a pixel value of 1 under a light of intensity 1")
    red, green, blue = shown = matrix @ ball
    is_white = all(NEUTRAL[0] < part / green < NEUTRAL[1] for part in (red, blue))
    warning = (
        f"frames.chart: by the ColorChecker the white ball's red, green and blue are {red / green:.2f} : 1 : "
        f"{blue / green:.2f}, not white. Was the chart lit by the same flash, and by it alone?"
    )
    stated = next((one.reflectance for one in job.session.spheres if one.kind == "white"), None)
    one = "as bright as the white ball" if stated is None else f"all light (the white ball: {stated:g}, as stated)"
    scale = (stated or 1.0) / float(LUMINANCE @ shown)
    return Colours(matrix * scale, source, colour, one, () if is_white else (warning,))


def results(job: Job) -> Outcome:
    """Write each method's maps, and one method's surface."""
    store, axes = job.store, job.settings.normals or "opengl"
    camera, lights, colours = store.load_camera(), store.load_lights(), albedo_colours(job)
    pixel_mm = pixel_size_mm(camera, lights)
    written: list[Path] = [store.path(FOLDER, "colour.json")]
    told_colour = {"camera_to_srgb": colours.matrix, "source": colours.source, "colour": colours.colour}
    write_json(written[0], {**told_colour, "one": colours.one})
    whites = {}
    for name in job.methods:
        for kind, values, told in method_maps(store, name, axes, colours):
            path = store.path(FOLDER, f"{kind}_{name}.tif")
            written += write_map(path, values, {"map": kind, "method": name, **told}, pixel_mm)
            whites[name] = told.get("white", whites.get(name))
    mask = store.load_mask()
    known = [name for name in job.methods if np.isfinite(store.load_normals(name)[mask]).all(-1).any()]
    warnings = [] if known else ["no method found a normal: there is no surface."]
    best = recommended(job)
    # What the report recommends comes before what found its depth itself.
    known = [best] if best in known else known
    surface = _write_surface(job, known, pixel_mm, written, colours) if known else None
    facts = {
        "files": [path.relative_to(store.folder).as_posix() for path in written],
        "pixel_mm": pixel_mm,
        "normals_axes": axes,
        "albedo_white": whites,
        "colour": told_colour,
        "surface": surface,
    }
    return Outcome(facts, [*warnings, *colours.warnings])


def recommended(job: Job) -> str | None:
    """Return the method that the report recommends; None where neither a truth nor the photographs tell of one."""
    told = {step: job.done.get(step, {}).get("result", {}) for step in ("compare", "trust")}
    is_told = (told["compare"].get("level") or {}).get("best") or told["trust"].get("recommended")
    return best_method(told) if is_told else None


def pixel_size_mm(camera: Camera, lights: Lights) -> float | None:
    """Return how large a pixel is on a surface that faces the camera at the object's distance; None: not known."""
    z_mm = float(lights.reference_point_mm[2])
    # Nothing tells an orthographic camera's scale.
    return -z_mm / float(np.sqrt(camera.fx * camera.fy)) if z_mm < 0 and not camera.is_orthographic else None


def method_maps(
    store: Store, method: str, axes: GreenAxis, colours: Colours
) -> Iterator[tuple[str, NDArray, dict[str, Any]]]:
    """Yield a method's maps as files hold them: kind, values (H, W) or (H, W, 3), and what the values mean.

    Normals and albedo, uint16, with the albedo that is white; sigma and depth, float32, where the method has them.
    """
    up, green = ("up", 1) if axes == "opengl" else ("down", -1)
    told: dict[str, Any] = {
        "value": "n = 2 code / 65535 - 1; 0 0 0: unknown",
        "axes": f"x right, y {up}, z toward the camera",
    }
    yield "normals", encode_normals(store.load_normals(method) * np.array([1, green, 1], np.float32)), told
    albedo = np.asarray(store.read_array("albedo", f"{method}.npy")) @ colours.matrix.T.astype(np.float32)
    known = albedo[np.isfinite(albedo)]
    white = HEADROOM * float(np.quantile(known, MOST)) if known.size else 1.0
    white = white if white > 0 else 1.0
    codes = np.nan_to_num(np.round(np.clip(albedo / white, 0, 1) * 65535)).astype(np.uint16)
    told = {"value": f"albedo = {white:.6g} code / 65535, linear; 1: {colours.one}", "white": white}
    yield "albedo", codes, {**told, "colour": colours.colour}
    for kind, value in (("sigma", "degrees, one standard deviation of the normal"), ("depth", "mm, z; negative")):
        if store.path(kind, f"{method}.npy").exists():
            yield kind, np.asarray(store.read_array(kind, f"{method}.npy"), np.float32), {"value": value}


def _write_surface(
    job: Job, methods: list[str], pixel_mm: float | None, written: list[Path], colours: Colours
) -> dict[str, Any]:
    """Write the surface of one of the methods as PLY and GLB, its depth as a map; return what is to be said of it."""
    from solve.surface.solved_surface import solved_surface
    from solve.surface.surface_mesh import mesh_of, write_surface

    store = job.store
    found = solved_surface(store, methods, VERTICES)
    mesh = mesh_of(found.surface, found.normals, found.albedo @ colours.matrix.T, found.camera)
    name = f"surface_{found.method}"
    ply, glb = (store.path(FOLDER, f"{name}.{kind}") for kind in ("ply", "glb"))
    write_surface(ply, mesh)
    # The picture's part that holds the object, at full size.
    v, u = (found.step * at for at in np.nonzero(np.isfinite(found.surface.z_mm)))
    box = PixelBox(int(u.min()), int(v.min()), int(u.max()) + 1, int(v.max()) + 1)
    part = np.asarray(box.of(store.read_array("albedo", f"{found.method}.npy"))) @ colours.matrix.T
    shrink = -(-max(part.shape[:2]) // TEXTURE_PX)
    white = float(np.nanquantile(part, MOST)) if np.isfinite(part).any() else 1.0
    shown = srgb_from_linear(np.nan_to_num(part[::shrink, ::shrink] / max(white, 1e-9)))
    picture = np.round(255 * shown).astype(np.uint8)
    size = shrink * np.array([picture.shape[1], picture.shape[0]])
    texcoords = (np.stack([u - box.left, v - box.top], 1) + 0.5 * shrink) / size
    write_glb(glb, replace(mesh, texcoords=texcoords), picture)
    written += [ply, glb]
    if not store.path("depth", f"{found.method}.npy").exists():
        told = {"map": "depth", "method": found.method, "value": f"mm, z; {found.scale}"}
        depth = store.path(FOLDER, f"depth_{found.method}.tif")
        size_mm, z_mm = pixel_mm and pixel_mm * found.step, found.surface.z_mm.astype(np.float32)
        written += write_map(depth, z_mm, told, size_mm)
    torn = found.surface.torn_share()
    facts = {"method": found.method, "scale": found.scale, "vertices": len(mesh.vertices), "torn_share": torn}
    return {**facts, "every_nth_pixel": found.step}
