"""Two sessions of one scanned object laid over each other through its scan: where did its surface change?"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import nudge, small_steps
from align.pose.scan_view import View, probe_rays, sample
from align.scan.smooth_normals import smooth_normals
from align.truth import EDGE_FOOTPRINTS
from capture.session.session import load_session
from compare.report.facts import best_method, read_optional
from compare.report.pictures import PixelBox, colour_scale_end, error_picture, with_colour_scale
from compare.statistics.change import (
    ACROSS,
    FINEST_PX,
    STATED,
    ChangedPlace,
    Tested,
    common_turn,
    fit_common,
    places,
    tested,
)
from formats.tiff_files import write_map
from lab.job import scan_of
from lab.results import pixel_size_mm
from lab.session_place import session_of
from scene.current import file_digest
from scene.errors import SceneError
from scene.files import write_npy, write_png
from scene.mesh import Mesh
from scene.normals import unit
from scene.rays import RayCaster
from scene.store import Store

Array = NDArray[np.float64]
Map = NDArray[np.float32]

FITTED = 40_000
"""Pixels, about, that tell what all normals share."""
BAND_PIXELS = 1 << 18
LIT = 0.5
"""Share of a place's pixels that every flash must light in both sessions: half."""


@dataclass(frozen=True)
class Side:
    """A session, its scan in place, and what one method found."""

    view: View
    normals: Map  # (H, W, 3), NaN where the scan's own is not known: at edges and holes, at grazing angles
    variance: Map  # (H, W): stated, of a normal along one tangent axis, square radians
    lit: NDArray[np.bool_]  # (H, W): the normal was fitted to all frames
    sigma_deg: float  # of the pose
    sigma_mm: float


class LaidOver(NamedTuple):
    """What P pixels of the first session see in both."""

    normals: Array  # (P, 3): the first's
    turned: Array  # (P, 3): the second's less the first's, radians; NaN where one is not known
    variance: Array  # (P,): of a turn along one tangent axis
    lit: NDArray[np.bool_]  # (P,): both normals were fitted to all frames
    steps_mm: Map  # (P, 2, 3): along the surface, to what the next pixel to the right, and the next below, see
    places: Array  # (P, 2): pixels of the second
    seen: tuple[Array, Array]  # points and the scan's normals (P, 3) there


def tell_change(before: Store, after: Store, methods: tuple[str, ...], out: Store) -> dict[str, Any]:
    """Write the maps of change and their picture, and tell what changed.

    Parameters
    ----------
    before, after : Store
        Output folders, their scan in place.
    methods : tuple of str
        That both have. The one that errs least before is taken.
    out : Store
        Gets change.npy, degrees, change_z.npy, sigmas, both also as .tif, and change.png.

    Returns
    -------
    dict
        method; verdict, in words; places, the highest first, see `ChangedPlace`; pixels that both see, the share of
        them that is stated to be flagged, and is; least_mm: the height that is still told; over_stated: how many times
        the stated sigmas the changes scatter by; common_deg: what all normals turned by, median; moved_px: how far the
        second pose was moved.

    Raises
    ------
    SceneError
        The two have no scan in common, or no method with a stated sigma.
    """
    method, pixel_mm = _method(before, after, methods), pixel_size_mm(before.load_camera(), before.load_lights())
    facts = _told(*_sides((before, after), method), out, pixel_mm)
    return {"method": method, **facts}


def _told(before: Side, after: Side, out: Store, pixel_mm: float | None) -> dict[str, Any]:
    """Lay the two over each other, write the maps, and return the facts."""
    rows, columns = np.nonzero(np.isfinite(before.normals[..., 0]))
    pixels = np.stack([columns, rows], -1).astype(np.float64)
    low, high = pixels.min(0), pixels.max(0)

    def common(laid: LaidOver, at: Array) -> Array:
        return common_turn(laid.normals, (2 * at - low - high) / (high - low).max())

    some = pixels[:: max(1, len(pixels) // FITTED)]
    laid = _lay_over(before, after, some)
    known = np.isfinite(laid.turned).all(1) & np.isfinite(laid.variance)
    if not known.any():
        raise SceneError("change: no part of the object is seen in both sessions.")
    steps = small_steps(after.view.caster.mesh, after.view.camera, after.view.pose, step_px=1.0)
    columns_of = np.concatenate([_moved(before, after, laid) * steps, common(laid, some)], -1)
    prior = np.repeat([np.radians(np.hypot(before.sigma_deg, after.sigma_deg)),
                       np.hypot(before.sigma_mm, after.sigma_mm)], 3) / np.sqrt(3) / steps  # fmt: skip
    found = fit_common(laid.turned[known], laid.variance[known], columns_of[known], prior)
    moved, bent = found[:6], found[6:]
    view = after.view
    after = replace(after, view=replace(view, pose=nudge(view.pose, -moved * steps, view.pivot)))

    turned, common_deg = np.full(before.normals.shape, np.nan), np.zeros(0)
    variance, lit = (np.full(turned.shape[:2], fill) for fill in (np.nan, False))
    steps_mm = np.full((*variance.shape, 2, 3), np.nan, np.float32)
    for first in range(0, len(pixels), BAND_PIXELS):
        part = slice(first, first + BAND_PIXELS)
        v, u = rows[part], columns[part]
        laid = _lay_over(before, after, pixels[part])
        shared = common(laid, pixels[part]) @ bent
        turned[v, u], variance[v, u] = laid.turned - shared, laid.variance
        lit[v, u], steps_mm[v, u] = laid.lit, laid.steps_mm
        common_deg = np.append(common_deg, np.degrees(np.linalg.norm(shared, axis=1)))
    change_deg = np.degrees(np.linalg.norm(turned, axis=-1)).astype(np.float32)
    test = tested(turned, variance, steps_mm)
    changed = places(test, change_deg, steps_mm, lit)
    _write_maps(out, change_deg, test, changed, pixel_mm)
    return {
        "verdict": _verdict(changed, test),
        "places": [place._asdict() for place in changed],
        "pixels": int(np.isfinite(test.square).sum()),
        "stated_share": STATED,
        "flagged_share": float(np.mean(test.square[np.isfinite(test.square)] > -2 * np.log(STATED))),
        "least_mm": test.least_mm,
        "over_stated": test.over_stated,
        "common_deg": float(np.median(common_deg)),
        "moved_px": float(np.linalg.norm(moved)),
    }


def _verdict(changed: list[ChangedPlace], test: Tested) -> str:
    clear = [place for place in changed if place.lit_share > LIT]
    if np.isnan(test.least_mm):
        text = "nothing can be told: of the object too little is seen in both sessions, in narrow pieces"
    elif not clear:
        text = (
            f"nothing changed: a dent of {test.least_mm:.2g} mm, {ACROSS * FINEST_PX:.0f} pixels across, would be told"
        )
    else:
        most, count = clear[0], len(clear)
        how = f"{'rose' if most.height_mm > 0 else 'sank'} by {abs(most.height_mm):.2g} mm"
        text = (
            f"changed at {count} place{'s' * (count > 1)}, most at pixel ({most.u:.0f}, {most.v:.0f}): {how}, over "
            f"{most.across_mm:.2g} mm"
        )
    if rest := len(changed) - len(clear):
        text += f"; {rest} more where a flash is shadowed or left out, which may be its error: look at change.png"
    return text


def _method(before: Store, after: Store, methods: tuple[str, ...]) -> str:
    stated = [name for name in methods if all(one.path("sigma", f"{name}.npy").exists() for one in (before, after))]
    if not stated:
        raise SceneError("change: no method of both sessions states a sigma (sigma/*.npy). Solve both by iterative.")
    best = best_method(read_optional(before, "summary.json") or {})
    return best if best in stated else stated[0]


def _sides(stores: tuple[Store, Store], method: str) -> tuple[Side, Side]:
    """Return both sessions with their scans in place."""
    sessions = [load_session(session_of(one.folder)) for one in stores]
    scans = {session.scan and file_digest(session.scan) for session in sessions}
    if None in scans or len(scans) > 1:
        raise SceneError(
            f"change: {stores[0].folder} and {stores[1].folder} have no scan in common, which tells what pixels of the "
            "two show the same place. Give both sessions one file: [object] scan. Process them again."
        )
    meshes = [scan_of(session, store) for session, store in zip(sessions, stores, strict=True)]
    smooth = smooth_normals(meshes[0])[0]
    before, after = (_side(store, mesh, smooth, method) for store, mesh in zip(stores, meshes, strict=True))
    return before, after


def _side(store: Store, mesh: Mesh, smooth: Array, method: str) -> Side:
    view = View(RayCaster(mesh, smooth), store.load_camera(), store.load_pose())
    normals, told = store.load_normals(method), store.read_json("pose.json")
    normals[~np.isfinite(store.load_normals("truth"))] = np.nan
    variance = np.radians(np.asarray(store.read_array("sigma", f"{method}.npy"))) ** 2
    lit = np.asarray(store.read_array("samples", f"{method}.npy")) >= len(store.load_lights())
    return Side(view, normals, variance, lit, told["sigma_deg"], told["sigma_mm"])


def _lay_over(before: Side, after: Side, pixels: Array) -> LaidOver:
    """Lay the second session's normals over the first's at pixels (P, 2), whole numbers, of the first."""
    scan, camera, (u, v) = after.view.caster.mesh, after.view.camera, pixels.astype(int).T
    hits, directions = before.view.hits(pixels), before.view.camera.rays(pixels)[1]
    # One file, whatever scale each session found for it: a place is a face and its corners' weights.
    points = after.view.pose.apply(hits.interpolate(scan, scan.vertices))
    places = camera.project(points)
    inside = np.asarray((places >= 0).all(1) & (places <= [camera.width - 1, camera.height - 1]).all(1))
    places = np.where(inside[:, None], places, 0.0)
    seen = after.view.surface(*camera.rays(places))
    width = (1.0 if camera.is_orthographic else -points[:, 2]) / camera.fx
    same = inside & (np.linalg.norm(seen[0] - points, axis=1) < EDGE_FOOTPRINTS * width)
    normals = before.normals[v, u].astype(np.float64)
    other = unit(np.stack([sample(after.normals[..., axis], places) for axis in range(3)], -1))
    turn = before.view.pose.rotation @ after.view.pose.rotation.T
    # Four pixels' noise on the mean, by the squares of their bilinear weights.
    across = places - np.floor(places)
    variance = sample(after.variance, places) * np.prod(1 - 2 * across + 2 * across**2, -1)
    mesh, lens = before.view.caster.mesh, before.view.camera
    depth = -before.view.pose.apply(hits.interpolate(mesh, mesh.vertices))[:, 2]
    aside = np.broadcast_to([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]], (len(depth), 2, 3)) / lens.fx
    aside = aside * (1.0 if lens.is_orthographic else depth[:, None, None])
    # Along the ray onto the tangent plane.
    facing = np.einsum("pk,pk->p", normals, directions)
    steps = aside - np.einsum("pkc,pc->pk", aside, normals / facing[:, None])[..., None] * directions[:, None]
    turned = np.where(same[:, None], other @ turn.T - normals, np.nan)
    lit = before.lit[v, u] & (sample(after.lit.astype(np.float32), places) == 1)
    return LaidOver(normals, turned, before.variance[v, u] + variance, lit, steps.astype(np.float32), places, seen)


def _moved(before: Side, after: Side, laid: LaidOver) -> Array:
    """Return (P, 3, 6): how the turns change with a twist of the second session's pose; see `nudge`."""
    slopes = after.view.normal_slopes(probe_rays(after.view.camera, laid.places), *laid.seen)
    return -np.einsum("ij,pjk->pik", before.view.pose.rotation @ after.view.pose.rotation.T, slopes)


def _write_maps(out: Store, change_deg: Map, test: Tested, changed: list[ChangedPlace], pixel_mm: float | None) -> None:
    """Write the change in degrees and its z as .npy and .tif, and the picture with the places that changed."""
    import cv2

    maps = {"change": (change_deg, "degrees"), "change_z": (np.sqrt(test.square).astype(np.float32), "sigmas")}
    for name, (values, told) in maps.items():
        write_npy(out.path(f"{name}.npy"), values)
        write_map(out.path(f"{name}.tif"), values, {"map": name, "value": told}, pixel_mm)
    box = PixelBox.of_mask(np.isfinite(change_deg), margin=0.03)
    end, times = colour_scale_end(float(np.nanquantile(change_deg, 0.95))), max(1, 800 // box.width)
    picture = np.ascontiguousarray(error_picture(box.of(change_deg), end).repeat(times, 0).repeat(times, 1))
    for place in changed:
        center = times * (np.array([place.u, place.v]) + 0.5 - [box.left, box.top])
        around = times * place.across_px / 2 + 2
        cv2.circle(picture, center.round().astype(int).tolist(), round(around), (225, 40, 40), max(1, times // 2))
    write_png(out.path("change.png"), with_colour_scale(picture, end, "change of the normal; red: places that changed"))
