"""Sessions of known truth, held in memory so that a mistake can be made in them, and written as a session's folder."""

import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.calibration_sessions import session_world
from benchmarks.harness import ROOT, SHARED
from fixtures.ball_scene import photograph
from scene.camera import Camera
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose
from scene.spheres import Sphere
from scene.store import Store
from twin.camera.virtual_camera import Sensor

Array = NDArray[np.float64]
BUNNY = SHARED / "sessions" / "bunny"
NAME = "flash_{:03d}"


class LackingError(Exception):
    """A session has not what a mistake is made in."""


@dataclass(frozen=True)
class Taken:
    """A session as its user took it: what is on the disk, and the truth that is in no file.

    Parameters
    ----------
    images : (F, H, W, 3) float32
        Linear, 1 is white, with the ambient light.
    ambient : (H, W, 3) float32 or None
    camera : dict
        The table [camera].
    balls : list of dict
        The tables [[spheres]].
    places : list of Sphere
        Where the balls truly are.
    vectors : (F, 3) float64
        From `middle_mm` to each frame's light, mm; of distant lights unit vectors.
    middle_mm : (3,) float64 or None
        The object's; None: the lights are distant.
    powers : (F, 3) float64
        The lights' radiant intensities, relative.
    object_mask : (H, W) bool
    normals : (H, W, 3) or None
        True ones; None where a mistake made the picture incomparable.
    scan : Mesh or None
    pose : Pose or None
        camera_from_scan.
    scan_center_mm : (3,) or None
        The scan's middle before anybody scaled or exchanged it.
    lights : (F, 3) float64 or None
        Of a light file: `vectors`, or what a mistake made of them.
    is_lp : bool
        The light file is an .lp though the lights are near; else it is a lights.json of positions then.
    mask : (H, W) bool or None
        A mask's file.
    frames : dict
        More keys of [frames].
    bits : int
        Of the files: 16, 8, or 0 for JPEG.
    exposures_s : (F,) or None
        EXIF's exposure times.
    """

    images: NDArray[np.float32]
    ambient: NDArray[np.float32] | None
    camera: dict[str, Any]
    balls: list[dict[str, Any]]
    places: list[Sphere]
    vectors: Array
    middle_mm: Array | None
    powers: Array
    object_mask: NDArray[np.bool_]
    normals: NDArray | None
    scan: Mesh | None = None
    pose: Pose | None = None
    scan_center_mm: Array | None = None
    lights: Array | None = None
    is_lp: bool = False
    mask: NDArray[np.bool_] | None = None
    frames: dict[str, Any] = field(default_factory=lambda: {"linear": True})
    bits: int = 16
    exposures_s: Array | None = None

    @property
    def dark(self) -> NDArray[np.float32]:
        """The ambient frame; raise LackingError where there is none."""
        if self.ambient is None:
            raise LackingError
        return self.ambient

    def directions(self, point_mm: Array) -> Array:
        """Return unit vectors (F, 3) from a point to the lights."""
        return unit(self.vectors if self.middle_mm is None else self.vectors + self.middle_mm - point_mm)

    def region(self, ball: int, *, grow_px: float = 0.0) -> NDArray[np.bool_]:
        """Return where a ball is in the picture (H, W)."""
        return self.places[ball].mask(Camera(**self.camera), grow_px=grow_px)

    def first(self, kind: str) -> int:
        """Return the number of the first ball of a kind; raise LackingError where there is none."""
        for number, ball in enumerate(self.balls):
            if ball["kind"] == kind:
                return number
        raise LackingError


def write(taken: Taken, folder: Path) -> None:
    """Write the session's folder."""
    (folder / "raw").mkdir(parents=True)
    suffix = {16: "tif", 8: "png", 0: "jpg"}[taken.bits]
    flash: dict[str, Any] = {"flash": f"raw/flash_*.{suffix}", **taken.frames}
    for i, image in enumerate(taken.images):
        _write_picture(folder / "raw" / f"{NAME.format(i)}.{suffix}", image, taken, i)
    if taken.ambient is not None:
        _write_picture(folder / "raw" / f"ambient.{suffix}", taken.ambient, taken, 0)
        flash["ambient"] = f"raw/ambient.{suffix}"
    tables = [("[frames]", flash), ("[camera]", taken.camera), *(("[[spheres]]", ball) for ball in taken.balls)]
    if taken.lights is not None:
        tables.append(("[lights]", {"file": _write_lights(folder, taken, taken.lights, suffix)}))
    known = {}
    if taken.scan is not None:
        import trimesh

        trimesh.Trimesh(taken.scan.vertices, taken.scan.faces, process=False).export(folder / "scan.ply")
        known["scan"] = "scan.ply"
    if taken.mask is not None:
        cv2.imwrite(str(folder / "mask.png"), 255 * taken.mask.astype(np.uint8))
        known["mask"] = "mask.png"
    lines = ['name = "case"']
    for head, keys in [*tables, ("[object]", known)]:
        lines += ["", head, *(f"{key} = {json.dumps(value)}" for key, value in keys.items())]
    (folder / "session.toml").write_text("\n".join([*lines, ""]))


def _write_lights(folder: Path, taken: Taken, vectors: Array, suffix: str) -> str:
    """Write lights.json of near lights, lights.lp of distant ones; return the file's name."""
    if taken.middle_mm is None or taken.is_lp:
        rows = [f"{NAME.format(i)}.{suffix} {x:.6f} {y:.6f} {z:.6f}" for i, (x, y, z) in enumerate(vectors)]
        (folder / "lights.lp").write_text("\n".join([str(len(rows)), *rows, ""]))
        return "lights.lp"
    names = tuple(NAME.format(i) for i in range(len(vectors)))
    irradiance = taken.powers / np.sum(vectors**2, 1, keepdims=True)
    lights = Lights(names, unit(vectors), irradiance, taken.middle_mm + vectors, taken.middle_mm)
    Store(folder).save_lights_json(lights.normalised())
    return "lights.json"


def _write_picture(path: Path, linear: NDArray, taken: Taken, index: int) -> None:
    """Write a picture of 16, 8 or 0 bits; `taken.frames` does not matter, the values are the file's."""
    import tifffile

    if taken.bits == 16:
        extra = []
        if taken.exposures_s is not None:
            time = (round(float(taken.exposures_s[index]) * 1_000_000), 1_000_000)
            extra = [(33434, "2I", 1, time, True), (33437, "2I", 1, (8, 1), True), (34855, "H", 1, 100, True)]
        codes = np.round(np.clip(linear, 0, 1) * 65535).astype(np.uint16)
        tifffile.imwrite(path, codes, photometric="rgb", metadata=None, extratags=extra)
    else:
        codes = np.round(np.clip(linear, 0, 1) * 255).astype(np.uint8)[..., ::-1]
        cv2.imwrite(str(path), codes, [] if taken.bits else [cv2.IMWRITE_JPEG_QUALITY, 30])


def rendered(folder: Path, truth: Path) -> Taken:
    """Return a session that another program rendered, with the truth beside it; of RAW files the superpixels."""
    from align.scan.mended_scan import load_scan
    from align.truth import ground_truth
    from capture.photographs.decode import decode
    from capture.session.session import load_session

    session = load_session(folder)
    is_half = session.flash[0].suffix == ".dng"
    with tempfile.TemporaryDirectory() as scratch:
        frames, _ = decode(replace(session, half=is_half), Store(Path(scratch)))
        images, ambient = frames.read(subtract_ambient=False), None
        if frames.ambient is not None:
            ambient = frames.frame(0, subtract_ambient=False) - frames.frame(0)
    camera, said = session.camera, json.loads((truth / "truth.json").read_text())
    assert isinstance(camera, Camera)
    assert session.scan is not None
    camera = camera.halved() if is_half else camera
    places = [
        Sphere(one["kind"], camera.project(np.array(one["centre_mm"])),
               one["radius_px"] * camera.width / said["width"], one["diameter_mm"])
        for one in said["spheres"]
    ]  # fmt: skip
    scan, pose = load_scan(session.scan, "mm"), Pose(np.array(said["camera_from_scan"]))
    if (truth / "truth.npz").is_file():
        maps = dict(np.load(truth / "truth.npz"))
        mask = maps["mask"][::2, ::2]
        normals = np.where(mask[..., None], unit(halved(maps["normals"].astype(np.float64))), np.nan)
        lights, powers = maps["light_positions_mm"], maps["light_power"]
    else:
        known = ground_truth(scan, pose, camera)
        mask, normals = known.mask, known.normals
        lights, powers = np.array(said["light_positions_mm"]), np.array(said["light_power"])[:, None].repeat(3, 1)
    middle = np.array(said["object_centre_mm"] if "object_centre_mm" in said else said["reference_point_mm"])
    return Taken(
        images, ambient, _table(camera), _stated(places), places, lights - middle, middle, powers, mask, normals, scan,
        pose, scan.center_mm,
    )  # fmt: skip


def halved(image: NDArray) -> NDArray:
    """Return the means (H / 2, W / 2, 3) of two by two pixels."""
    height, width = (size // 2 * 2 for size in image.shape[:2])
    return image[:height, :width].reshape(height // 2, 2, width // 2, 2, 3).mean((1, 3))


def _table(camera: Camera) -> dict[str, Any]:
    return {key: getattr(camera, key) for key in ("width", "height", "fx", "fy", "cx", "cy")}


def _stated(places: list[Sphere]) -> list[dict[str, Any]]:
    return [{"kind": place.kind, "diameter_mm": place.diameter_mm} for place in places]


def ray_traced(seed: int, kind: str) -> Taken:
    """Return a session of the ray tracer: balls around three lumps on a table, its superpixels."""
    world = session_world(seed, kind)
    # The room's light is 1 to 3 % of the flash in most sessions; in every third one it is ten times that.
    if seed % 3 == 0:
        world.ambient = np.asarray(world.ambient) * 10
    rng = np.random.default_rng([seed, 7])
    shot = photograph(world, Sensor(blur_px=float(rng.uniform(0.45, 0.85))), rng, ambient_frame=True)
    camera = world.camera.halved()
    size = (camera.height, camera.width)
    normals, surface, depth = np.full((*size, 3), np.nan), np.full((*size, 3), np.nan), np.full(size, -np.inf)
    for ball in world.balls:
        if ball.kind == "object":
            radius = camera.fx * ball.radius / -ball.center[2]
            lump = Sphere("white", camera.project(ball.center), radius, 2 * ball.radius)
            v, u = np.nonzero(lump.mask(camera))
            found, points = lump.normals(camera, np.stack([u, v], -1))
            nearer = points[:, 2] > depth[v, u]
            at = v[nearer], u[nearer]
            normals[at], surface[at], depth[at] = found[nearer], points[nearer], points[nearer, 2]
    mask = np.isfinite(depth)
    middle = surface[mask].mean(0)
    places = [
        replace(one, center_px=camera.project(one.center_mm(world.camera)), radius_px=one.radius_px / 2)
        for one in world.spheres()
    ]
    is_far = kind == "far"
    vectors = world.truth(middle)[0] if is_far else world.lights - middle
    return Taken(
        np.stack([halved(shot.frame(i, subtract_ambient=False)) for i in range(len(shot))]),
        halved(shot.frame(0, subtract_ambient=False) - shot.frame(0)),
        _table(camera), _stated(places), places, vectors, None if is_far else middle, np.asarray(world.powers), mask,
        normals, mask=mask,
    )  # fmt: skip


def _fixture() -> Taken:
    folder = ROOT / "fixtures" / "bumpy"
    return rendered(folder, folder)


SESSIONS: dict[str, Callable[[], Taken]] = {
    "bunny": lambda: rendered(BUNNY, BUNNY),
    "balls 903": lambda: ray_traced(903, "two"),
    "far 902": lambda: ray_traced(902, "far"),
    "fixture": _fixture,
    "fixture without scan": lambda: replace(_fixture(), scan=None),
}
"""Thresholds were chosen on the fixture; some were checked on the bunny."""


@cache
def session(name: str) -> Taken:
    """Return a session, made once a process."""
    return SESSIONS[name]()
