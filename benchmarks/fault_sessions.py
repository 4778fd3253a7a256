"""Sessions of known truth, held in memory so that a mistake can be made in them, and written as a session's folder.

Sessions that were looked at while thresholds were chosen are in `LOOKED_AT`; figures are of the others.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose
from scene.spheres import Sphere
from scene.store import Store

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[1]
BUNNY = ROOT.parent / "shared" / "sessions" / "bunny"
NAME = "flash_{:03d}"


@dataclass(frozen=True)
class Taken:
    """A session as its user took it: what is on the disk, and the truth that is in no file.

    Parameters
    ----------
    images : (F, H, W, 3) float32
        Linear, 1 is white, with the ambient light.
    ambient : (H, W, 3) float32 or None
    camera : dict
        The table [camera]; empty: none.
    balls : list of dict
        The tables [[spheres]].
    lights : (F, 3) float64 or None
        Of a light file: directions, or vectors in mm from `middle_mm` to the lights, where these are near.
    mask : (H, W) bool or None
        A mask's file.
    scan : Mesh or None
    frames, object : dict
        More keys of [frames] and [object].
    bits : int
        Of the files: 16, 8, or 0 for JPEG.
    exposures_s : (F,) or None
        EXIF's exposure times.
    places : list of Sphere
        Where the balls truly are.
    directions : (F, 3) float64
        To each frame's light, at the object.
    object_mask : (H, W) bool
    normals : (H, W, 3) or None
        True ones; None where a mistake made the picture incomparable.
    pose : Pose or None
        camera_from_scan.
    """

    images: NDArray[np.float32]
    ambient: NDArray[np.float32] | None
    camera: dict[str, Any]
    balls: list[dict[str, Any]]
    places: list[Sphere]
    directions: Array
    object_mask: NDArray[np.bool_]
    normals: NDArray | None
    scan: Mesh | None = None
    pose: Pose | None = None
    lights: Array | None = None
    mask: NDArray[np.bool_] | None = None
    frames: dict[str, Any] = field(default_factory=lambda: {"linear": True})
    object: dict[str, Any] = field(default_factory=dict)
    bits: int = 16
    exposures_s: Array | None = None
    middle_mm: Array | None = None
    """The object's, where the lights are near: their file is a lights.json with positions, else an .lp."""
    vectors_mm: Array | None = None
    """(F, 3) from there to the lights; with it `powers` (F, 3), relative."""
    powers: Array | None = None
    true_center_mm: Array | None = None
    """The scan's middle before anybody scaled or exchanged it."""

    def region(self, ball: int, *, grow_px: float = 0.0) -> NDArray[np.bool_]:
        """Return where a ball is in the picture (H, W)."""
        return self.places[ball].mask(Camera(**self.camera), grow_px=grow_px)

    def first(self, kind: str) -> int:
        """Return the number of the first ball of a kind."""
        return [ball["kind"] for ball in self.balls].index(kind)


def write(taken: Taken, folder: Path) -> None:
    """Write the session's folder."""
    (folder / "raw").mkdir(parents=True)
    suffix = {16: "tif", 8: "png", 0: "jpg"}[taken.bits]
    tables: list[tuple[str, dict]] = [("[frames]", {"flash": f"raw/flash_*.{suffix}", **taken.frames})]
    for i, image in enumerate(taken.images):
        _write_picture(folder / "raw" / f"{NAME.format(i)}.{suffix}", image, taken, i)
    if taken.ambient is not None:
        _write_picture(folder / "raw" / f"ambient.{suffix}", taken.ambient, taken, 0)
        tables[0][1]["ambient"] = f"raw/ambient.{suffix}"
    if taken.camera:
        tables.append(("[camera]", taken.camera))
    tables += [("[[spheres]]", ball) for ball in taken.balls]
    if taken.lights is not None:
        tables.append(("[lights]", {"file": _write_lights(folder, taken, suffix)}))
    known = dict(taken.object)
    if taken.scan is not None:
        import trimesh

        trimesh.Trimesh(taken.scan.vertices, taken.scan.faces, process=False).export(folder / "scan.ply")
        known["scan"] = "scan.ply"
    if taken.mask is not None:
        import cv2

        cv2.imwrite(str(folder / "mask.png"), 255 * taken.mask.astype(np.uint8))
        known["mask"] = "mask.png"
    tables.append(("[object]", known))
    lines = ['name = "case"']
    for head, keys in tables:
        lines += ["", head, *(f"{key} = {json.dumps(value)}" for key, value in keys.items())]
    (folder / "session.toml").write_text("\n".join([*lines, ""]))


def _write_lights(folder: Path, taken: Taken, suffix: str) -> str:
    """Write lights.json of near lights, lights.lp of distant ones; return the file's name."""
    vectors = taken.lights
    assert vectors is not None
    if taken.middle_mm is None or taken.powers is None:
        rows = [f"{NAME.format(i)}.{suffix} {x:.6f} {y:.6f} {z:.6f}" for i, (x, y, z) in enumerate(vectors)]
        (folder / "lights.lp").write_text("\n".join([str(len(rows)), *rows, ""]))
        return "lights.lp"
    intensities = taken.powers / np.sum(vectors**2, 1, keepdims=True)
    Store(folder).save_lights(
        Lights(
            tuple(NAME.format(i) for i in range(len(vectors))),
            unit(vectors),
            intensities,
            taken.middle_mm + vectors,
            taken.middle_mm,
        ).normalised()
    )
    return "lights.json"


def _write_picture(path: Path, linear: NDArray, taken: Taken, index: int) -> None:
    """Write a picture of 16, 8 or 0 bits; `taken.frames` does not matter, the values are the file's."""
    import cv2
    import tifffile

    if taken.bits == 16:
        codes = np.round(np.clip(linear, 0, 1) * 65535).astype(np.uint16)
        extra = []
        if taken.exposures_s is not None:
            time = (round(float(taken.exposures_s[index]) * 1_000_000), 1_000_000)
            extra = [(33434, "2I", 1, time, True), (33437, "2I", 1, (8, 1), True), (34855, "H", 1, 100, True)]
        tifffile.imwrite(path, codes, photometric="rgb", metadata=None, extratags=extra)
        return
    codes = np.round(np.clip(linear, 0, 1) * 255).astype(np.uint8)[..., ::-1]
    cv2.imwrite(str(path), codes, [] if taken.bits else [cv2.IMWRITE_JPEG_QUALITY, 30])


def photographed(folder: Path, scratch: Path) -> Taken:
    """Return a session that another program rendered, its superpixels, with the truth that lies beside it."""
    from align.scan.mended_scan import load_scan
    from capture.photographs.decode import decode
    from capture.session.session import load_session

    session = replace(load_session(folder), half=True)
    frames, _ = decode(session, Store(scratch))
    camera = session.camera
    assert isinstance(camera, Camera)
    camera = camera.halved()
    truth, maps = json.loads((folder / "truth.json").read_text()), np.load(folder / "truth.npz")
    places = [
        Sphere(s["kind"], camera.project(np.array(s["centre_mm"])), s["radius_px"] / 2, s["diameter_mm"])
        for s in truth["spheres"]
    ]
    middle = np.array(truth["object_centre_mm"])
    mask, normals = maps["mask"][::2, ::2], _halved(maps["normals"].astype(np.float64))
    assert session.scan is not None
    scan = load_scan(session.scan, "mm")
    return Taken(
        frames.read(subtract_ambient=False),
        None if frames.ambient is None else frames.frame(0, subtract_ambient=False) - frames.frame(0),
        _table(camera),
        [{"kind": place.kind, "diameter_mm": place.diameter_mm} for place in places],
        places,
        unit(maps["light_positions_mm"] - middle),
        mask,
        np.where(mask[..., None], normals, np.nan),
        scan,
        Pose(np.array(truth["camera_from_scan"])),
        middle_mm=middle,
        vectors_mm=maps["light_positions_mm"] - middle,
        powers=maps["light_power"],
        true_center_mm=scan.center_mm,
    )


def _halved(normals: Array) -> Array:
    height, width = (size // 2 * 2 for size in normals.shape[:2])
    return unit(normals[:height, :width].reshape(height // 2, 2, width // 2, 2, 3).mean((1, 3)))


def _table(camera: Camera) -> dict[str, Any]:
    return {key: getattr(camera, key) for key in ("width", "height", "fx", "fy", "cx", "cy")}


def ray_traced(seed: int, kind: str = "two") -> Taken:
    """Return a session of the ray tracer: balls around three lumps on a table, its superpixels."""
    from benchmarks.calibration_sessions import session_world
    from fixtures.ball_scene import photograph
    from twin.camera.virtual_camera import Sensor

    world = session_world(seed, kind)
    # The room's light is 1 to 3 % of the flash in most sessions; in every third one it is ten times that.
    if seed % 3 == 0:
        world.ambient = np.asarray(world.ambient) * 10
    rng = np.random.default_rng([seed, 7])
    shot = photograph(world, Sensor(blur_px=float(rng.uniform(0.45, 0.85))), rng, ambient_frame=True)
    halve: Callable[[NDArray], NDArray] = lambda image: image.reshape(  # noqa: E731
        image.shape[0] // 2, 2, image.shape[1] // 2, 2, 3
    ).mean((1, 3))
    camera = world.camera.halved()
    lumps = [
        Sphere("white", camera.project(ball.center), camera.fx * ball.radius / -ball.center[2], 2 * ball.radius)
        for ball in world.balls
        if ball.kind == "object"
    ]
    size = (camera.height, camera.width)
    normals, surface, depth = np.full((*size, 3), np.nan), np.full((*size, 3), np.nan), np.full(size, -np.inf)
    for lump in lumps:
        v, u = np.nonzero(lump.mask(camera))
        found, points = lump.normals(camera, np.stack([u, v], -1))
        nearer = points[:, 2] > depth[v, u]
        normals[v[nearer], u[nearer]], surface[v[nearer], u[nearer]] = found[nearer], points[nearer]
        depth[v[nearer], u[nearer]] = points[nearer, 2]
    mask = np.isfinite(depth)
    middle = surface[mask].mean(0)
    near = {} if kind == "far" else {"middle_mm": middle, "vectors_mm": world.lights - middle, "powers": world.powers}
    places = [
        replace(s, center_px=camera.project(s.center_mm(world.camera)), radius_px=s.radius_px / 2)
        for s in world.spheres()
    ]
    ambient = shot.frame(0, subtract_ambient=False) - shot.frame(0)
    return Taken(
        np.stack([halve(shot.frame(i, subtract_ambient=False)) for i in range(len(shot))]),
        halve(ambient),
        _table(camera),
        [{"kind": place.kind, "diameter_mm": place.diameter_mm} for place in places],
        places,
        world.truth(middle)[0],
        mask,
        normals,
        mask=mask,
        **near,
    )


def virtual(seed: int, scratch: Path) -> Taken:
    """Return a virtual capture of `benchmarks.virtual_pairs`: a white sphere amid balls, 16 flashes, by Mitsuba."""
    from benchmarks.virtual_lab import BALLS, CAMERA, CENTRE_MM, Setup, lab_scene
    from benchmarks.virtual_pairs import write_capture
    from capture.photographs.decode import decode
    from capture.session.session import load_session

    setup = Setup(seed=seed)
    write_capture(Store(scratch / "capture"), setup, "virtual")
    session = load_session(scratch / "capture")
    frames, _ = decode(session, Store(scratch / "decoded"))
    lights = lab_scene(setup).lights
    assert lights.positions_mm is not None
    kept = list(session.kept)
    vectors = lights.positions_mm[kept] - CENTRE_MM
    mask, normals = Store(scratch / "capture").load_mask(), np.load(scratch / "capture" / "truth.npy")
    places = [
        Sphere(kind, CAMERA.project(np.array(center)), CAMERA.fx * radius / -center[2], 2 * radius)  # type: ignore[arg-type]
        for kind, radius, center in BALLS
    ]
    return Taken(
        frames.read(),
        None,
        _table(CAMERA),
        [{"kind": place.kind, "diameter_mm": place.diameter_mm} for place in places],
        places,
        unit(vectors),
        mask,
        normals,
        mask=mask,
        middle_mm=CENTRE_MM,
        vectors_mm=vectors,
        powers=lights.intensities[kept] * np.sum(vectors**2, 1, keepdims=True),
    )


SESSIONS: dict[str, Callable[[Path], Taken]] = {
    "bumpy": lambda scratch: photographed(ROOT / "fixtures" / "bumpy", scratch),
    "balls 2001": lambda scratch: ray_traced(2001),
    "far 2002": lambda scratch: ray_traced(2002, "far"),
    "bunny": lambda scratch: photographed(BUNNY, scratch),
    "balls 903": lambda scratch: ray_traced(903),
    "far 902": lambda scratch: ray_traced(902, "far"),
    "virtual 7": lambda scratch: virtual(7, scratch),
}
LOOKED_AT = ("bumpy", "balls 2001", "far 2002")
"""Thresholds were chosen on these."""
WITH_SCAN = ("bumpy", "bunny")
