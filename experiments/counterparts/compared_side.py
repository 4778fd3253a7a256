"""A processed folder as one side of a comparison: the methods' errors, and what lights and registration leave open."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from scene.pose import rotation_from_vector
from scene.reading import array_of
from scene.store import Store

Array = NDArray[np.float64]
Map = NDArray[np.float32]

MOVES = 24
"""How often lights and registration are moved."""
PIXELS = 3000
"""Of the object, that are solved again under moved lights."""
VIRTUAL = "virtual.json"
"""In a session that a virtual camera took, and in what was made of it."""


@dataclass(frozen=True)
class Folder:
    """A folder that `process`, or `twin`, has left.

    Parameters
    ----------
    store : Store
    kind : {"photographs", "virtual capture", "rendering"}
    methods : tuple of str
        Whose normals are there.
    truth : (H, W, 3) float32
    mask : (H, W) bool
    """

    store: Store
    kind: str
    methods: tuple[str, ...]
    truth: Map
    mask: NDArray[np.bool_]

    @property
    def name(self) -> str:
        """The session's, or the folder's."""
        from compare.report.facts import read_optional

        here = self.store.folder.resolve()
        told = (read_optional(self.store, "summary.json") or {}).get("name")
        return str(told or (f"{here.parent.name} twin" if here.name == "twin" else here.name))


def open_folder(path: Path) -> Folder:
    """Return a processed folder.

    Raises
    ------
    SceneError
        There are no normals in it, or no ground truth.
    """
    from compare.report.facts import method_names

    if not path.is_dir():
        raise SceneError(f"{path}: is no folder. Give two output folders of `rgbn process`, or one and its twin/.")
    store = Store(path)
    rendered = path.joinpath("session.toml").exists() and path.joinpath("truth.npy").exists()
    truth = store.path("truth.npy") if rendered else store.path("normals", "truth.npy")
    methods = tuple(name for name in method_names(store) if store.path("normals", f"{name}.npy").exists())
    if not methods:
        raise SceneError(
            f"{path}: found no methods' normals (normals/*.npy). Expected an output folder of `rgbn process`, or the "
            "twin/ in it: process the session first."
        )
    if not truth.exists():
        raise SceneError(
            f"{path}: found no ground truth ({truth.name}), so no errors can be compared. Give the session a scan or "
            "normals, and process it again."
        )
    kind = "rendering" if rendered else "virtual capture" if store.path(VIRTUAL).exists() else "photographs"
    normals, mask = np.array(array_of(truth)), store.load_mask()
    if normals.shape != (*mask.shape, 3):
        raise SceneError(f"{path}: {truth.name} is {normals.shape[:2]} px, mask.png {mask.shape}. Process it again.")
    return Folder(store, kind, methods, normals, mask)


def error_maps(folder: Folder, methods: Sequence[str]) -> dict[str, Map]:
    """Return each method's error map (H, W), degrees, NaN outside the mask."""
    maps = {}
    for name in methods:
        error = np.full(folder.mask.shape, np.nan, np.float32)
        normals = folder.store.load_normals(name)
        if normals.shape != folder.truth.shape:
            raise SceneError(
                f"{folder.store.folder}: normals/{name}.npy is {normals.shape[:2]} px, the truth "
                f"{folder.truth.shape[:2]}. Process into an empty folder."
            )
        error[folder.mask] = angular_error_deg(normals[folder.mask], folder.truth[folder.mask])
        maps[name] = error
    return maps


def shifts_of(folder: Folder, methods: Sequence[str], *, seed: int = 0) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return what the errors change by when lights and registration move by their sigmas.

    Parameters
    ----------
    folder : Folder
    methods : sequence of str
    seed : int

    Returns
    -------
    shifts : dict of str to (MOVES, 4) float64
        By method, in the order of `compare.statistics.block_bootstrap.KEYS`; row k is one movement for all methods.
        Empty where nothing is to be carried.
    carried : dict
        direction_sigma_deg, intensity_sigma (medians), pose_sigma_deg, pose_sigma_mm; each None where it is zero or
        unknown; pixels, moves; not_carried: methods that could not be run again; why, where nothing was moved: the
        reason, in words.

    Notes
    -----
    The stack is thinned to every n-th pixel. Each movement turns every light by its sigma along two tangent axes,
    scales its intensity by its sigma, turns the true normals by the pose's sigma and shifts them by its millimetres;
    then every method solves again, and its statistics are held against those of the thinned stack unmoved.
    A rendering's lights and truth are what it was made from: nothing is open there.
    """
    from compare.statistics.block_bootstrap import KEYS
    from compare.statistics.statistics import angular_statistics

    lights, camera = folder.store.load_lights(), _camera(folder.store)
    pose = folder.store.read_json("pose.json") if folder.store.path("pose.json").exists() else {}
    sigmas = {
        "direction_sigma_deg": _median(lights.direction_sigma_deg),
        "intensity_sigma": _median(lights.intensity_sigma),
        # Rms lengths of vectors, see `align.pose.register`: along one axis less by the root of 3.
        "pose_sigma_deg": pose.get("sigma_deg"),
        "pose_sigma_mm": pose.get("sigma_mm"),
    }
    why = _not_moved(folder, any(sigmas.values()), camera)
    if why or camera is None:
        return {}, {**sigmas, "moves": 0, "pixels": 0, "not_carried": [], "why": why}
    step = int(np.ceil(np.sqrt(max(1.0, folder.mask.sum() / PIXELS))))
    frames, small = folder.store.load_frames(), _thinned(camera, step)
    thin = replace(
        frames,
        codes=np.ascontiguousarray(frames.codes[:, ::step, ::step]),
        ambient=None if frames.ambient is None else np.ascontiguousarray(frames.ambient[::step, ::step]),
    )
    mask, rng = folder.mask[::step, ::step], np.random.default_rng(seed)
    moved = [(lights, np.asarray(folder.truth[::step, ::step], np.float64))]
    depth = abs(float(lights.reference_point_mm[2])) or 1.0
    for _ in range(MOVES):
        truth = _moved_truth(folder.truth, pose, camera.fx / depth, rng)[::step, ::step]
        moved.append((_moved_lights(lights, rng), truth))
    shifts, left_out = {}, []
    for name in methods:
        found = []
        for light, truth in moved:
            normals = _solved(folder.store, name, thin, light, small, mask)
            if normals is None:
                break
            statistics = angular_statistics(angular_error_deg(normals[mask], truth[mask]))
            found.append([statistics[key] for key in KEYS])
        if len(found) < len(moved) or not np.isfinite(found).all():
            left_out.append(name)
            continue
        shifts[name] = np.array(found[1:]) - found[0]
    return shifts, {**sigmas, "moves": MOVES, "pixels": int(mask.sum()), "not_carried": left_out}


def _not_moved(folder: Folder, known: bool, camera: Camera | None) -> str:
    """Return why lights and registration of a folder cannot be moved; empty where they can."""
    if folder.kind == "rendering":
        return "lights and truth are exact: it was rendered from them"
    if not known:
        return "nothing says how uncertain its lights and registration are"
    missing = ["camera.json"] if camera is None else []
    if not folder.store.path("frames", "frames.json").exists():
        missing.append("frames/")
    if not missing:
        return ""
    return f"{' and '.join(missing)} missing, so it could not be solved again under moved lights and registration"


def _solved(
    store: Store, method: str, frames: Frames, lights: Lights, camera: Camera, mask: NDArray[np.bool_]
) -> Map | None:
    """Return a method's normals with the profile that it ran with; None where it cannot be run again."""
    from compare.report.facts import read_optional
    from solve.solve import METHODS, solve

    if method not in METHODS:
        return None
    ran = ((read_optional(store, "summary.json") or {}).get("solve") or {}).get("methods") or {}
    profile = (ran.get(method) or {}).get("profile", "default")
    try:
        return solve(method, frames, lights, camera, mask, profile=profile).normals
    except SceneError:
        return None


def _camera(store: Store) -> Camera | None:
    # A twin's camera is that of the session around it.
    for place in (store, Store(store.folder.parent)):
        if place.path("camera.json").exists():
            return place.load_camera()
    return None


def _thinned(camera: Camera, step: int) -> Camera:
    """Return the camera of every n-th pixel: pixel u becomes u / n."""
    width, height = -(-camera.width // step), -(-camera.height // step)
    near = {"fx": camera.fx / step, "fy": camera.fy / step, "cx": camera.cx / step, "cy": camera.cy / step}
    return replace(camera, width=width, height=height, **near)


def _moved_lights(lights: Lights, rng: np.random.Generator) -> Lights:
    """Return lights turned and scaled by their sigmas; a near one keeps its distance."""
    direction, intensity = (np.nan_to_num(one) for one in (lights.direction_sigma_deg, lights.intensity_sigma))
    aside = np.radians(direction)[:, None] * rng.standard_normal((len(lights), 3))
    aside -= np.sum(aside * lights.directions, 1, keepdims=True) * lights.directions
    directions = unit(lights.directions + aside)
    intensities = lights.intensities * (1 + intensity * rng.standard_normal(len(lights)))[:, None]
    positions = lights.positions_mm
    if positions is not None:
        distance = np.linalg.norm(positions - lights.reference_point_mm, axis=1, keepdims=True)
        positions = lights.reference_point_mm + distance * directions
    return replace(lights, directions=directions, intensities=intensities, positions_mm=positions)


def _moved_truth(truth: Map, pose: dict[str, Any], pixels_per_mm: float, rng: np.random.Generator) -> Array:
    """Return true normals turned and shifted by the pose's sigmas; a shift in depth is left out."""
    if not pose:
        return np.asarray(truth, np.float64)
    turn = np.radians(pose["sigma_deg"] / np.sqrt(3)) * rng.standard_normal(3)
    across, down = pose["sigma_mm"] / np.sqrt(3) * pixels_per_mm * rng.standard_normal(2)
    return _shifted(truth, across, down) @ rotation_from_vector(turn).T


def _shifted(normals: Map, across: float, down: float) -> Array:
    """Return a map moved by parts of a pixel, NaN where it is then unknown."""
    import cv2

    height, width = normals.shape[:2]
    motion = np.array([[1, 0, across], [0, 1, down]], np.float64)
    known = np.isfinite(normals[..., 0])
    filled = np.where(known[..., None], normals, 0).astype(np.float32)
    moved = np.asarray(cv2.warpAffine(filled, motion, (width, height), flags=cv2.INTER_LINEAR), np.float64)
    share = cv2.warpAffine(known.astype(np.float32), motion, (width, height), flags=cv2.INTER_LINEAR)
    moved[np.asarray(share) < 0.5] = np.nan
    return unit(moved)


def _median(values: Array) -> float | None:
    known = values[np.isfinite(values) & (values > 0)]
    return float(np.median(known)) if known.size else None
