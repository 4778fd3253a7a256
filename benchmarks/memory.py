"""Own memory and processor seconds of each verb on a session as large as they come: 24 megapixels, sixty photographs.

An object of fixtures/mesh_shapes stands among two chrome balls and a white one on a table (fixtures/ball_scene);
truth is known, and memory is bounded. Direct light, photographed at half the size, enlarged, and exposed by the
virtual camera at full size: edges are as soft as those of a lens a little out of focus, noise is of full resolution.
Twelve different flashes, each photograph listed several times: memory does not care whether two are alike. Each verb
runs in a process of its own, under the limit that it is to keep; what the verbs before it made is there.
"""

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from benchmarks.harness import ROOT, Figures, Scale, Table, markdown, ran
from fixtures.ball_scene import World, radiance
from fixtures.ball_scene import flashes as place_flashes
from fixtures.mesh_scene import Scene, Tracer, random_rotation
from fixtures.mesh_shapes import SHAPES, scan_of, subdivided
from scene.camera import Camera
from scene.files import write_json, write_text
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose
from twin.camera.virtual_camera import Sensor, expose, write_dng

FLASHES = 12
LIMIT_GB = 4.0
"""What is reserved counts too, so this is harder than a machine with so much memory."""
TWIN_ERROR = 0.2
"""Of the twin's rendering; memory does not depend on it, and the time is not what is measured here."""
CAMERA = Camera(1200, 800, 1666.7, 1666.7, 606.8, 394.9)
CENTRE = np.array([0.0, 0.0, -1000.0])
OBJECT_SCALE = 3.0
AMBIENT_SHOWN = 0.4
"""Of the ambient light on white, what the object shows."""
AT_ONCE = 4
"""Frames traced together."""
SENSOR = Sensor(full_well_e=40000, blur_px=0.8)


def write_session(
    folder: Path, *, width: int, flashes: int, faces: int, times: int = 1, shape: str = "relief", seed: int = 0
) -> Path:
    """Write session.toml, frames and an ambient frame as DNG, the scan, and truth.json.

    Parameters
    ----------
    folder : Path
    width : int
        Of the photographs, pixels; two thirds as high. A multiple of 12.
    flashes, faces : int
        Different flashes; triangles of the scan.
    times : int
        How often each photograph is listed, under names of its own: memory does not care whether two are alike.
    shape : str
        Of `fixtures.mesh_shapes.SHAPES`.
    seed : int
    """
    import cv2
    import trimesh

    rng = np.random.default_rng([seed, 24])
    scene, world, scan, camera_from_scan = _scene(shape, rng, seed, width=width // 2, count=flashes, faces=faces)
    for name in ("raw", "scan"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    trimesh.Trimesh(scan.vertices, scan.faces, process=False).export(folder / "scan" / "object.ply")
    tracer = Tracer(scene)
    points, normals, rays, on_object, weight, pixel = tracer.look()
    points, normals, rays = points[on_object], normals[on_object], rays[on_object]
    weight, pixel = weight[on_object], pixel[on_object]
    albedo, size = scene.texture(points, np.ones(len(points), bool)), (width, width * 2 // 3)
    rest = 1 - tracer.cover[..., None]

    def shoot(name: str, image: np.ndarray, second: int) -> None:
        linear = cv2.resize(image, size, interpolation=cv2.INTER_CUBIC)
        mosaic = expose(np.maximum(linear, 0), SENSOR, rng)
        shot = {"exposure_s": 0.01, "iso": 100, "aperture": 8.0, "focal_mm": CAMERA.fx * width / CAMERA.width * 0.005}
        time = datetime(2026, 1, 1, 12) + timedelta(seconds=second)
        write_dng(folder / "raw" / f"{name}.dng", mosaic, SENSOR, **shot, time=time)

    def blend(behind: np.ndarray, own: np.ndarray) -> np.ndarray:
        return (rest * behind + own + (1 - rest) * AMBIENT_SHOWN * np.asarray(world.ambient)).astype(np.float32)

    for first in range(0, flashes, AT_ONCE):
        images, standing = radiance(world, slice(first, first + AT_ONCE))
        if first == 0:
            shoot("ambient_000", blend(standing, np.zeros(())), -10)
        for index, image in enumerate(images, first):
            lit = tracer.light(index, points, normals, rays, np.ones(len(points), bool), albedo)
            own = np.stack([np.bincount(pixel, weight * lit[:, k], tracer.count) for k in range(3)], -1)
            shoot(f"flash_{index:03d}", blend(image, own.reshape(image.shape)), 2 * index)
    for index in range(flashes, times * flashes):
        (folder / "raw" / f"flash_{index:03d}.dng").symlink_to(f"flash_{index % flashes:03d}.dng")
    write_json(folder / "truth.json", {"camera_from_scan": camera_from_scan.matrix, "light_positions_mm": world.lights})
    write_text(folder / "session.toml", _manifest(width, world))
    return folder / "session.toml"


def _scene(
    shape: str, rng: np.random.Generator, seed: int, *, width: int, count: int, faces: int
) -> tuple[Scene, World, Mesh, Pose]:
    """Return the object's part, the balls' part, the scan, and the pose of the scan."""
    fine = SHAPES[shape]()
    while len(fine.faces) < faces:
        fine = subdivided(fine)
    fine = Mesh(OBJECT_SCALE * fine.vertices, fine.faces)
    factor = width / CAMERA.width
    camera = CAMERA.scaled(width, width * 2 // 3, factor, factor)
    positions = place_flashes(count, near_mm=700, far_mm=1200, center=CENTRE, seed=int(rng.integers(1 << 31)))
    powers = rng.uniform(0.75, 1.3, (count, 1)) * rng.uniform(0.96, 1.04, (count, 3))
    world = World(camera, [], positions, powers, ambient=0.006, table_texture="noise", table_second=0.1)
    world.stand("chrome", -215, -120, 42).stand("chrome", 225, 115, 42).stand("white", -220, 120, 38)
    # Pixel values of 0.7 where a white surface, and the object's nearest point, face the nearest flash.
    world.powers = 0.45 * powers / (powers * (1000 / np.linalg.norm(positions - CENTRE, axis=1)[:, None]) ** 2).max()
    # Of its own stream: the object stands alike whatever the number of flashes.
    rotation = random_rotation(np.random.default_rng([seed, 3]))
    turned = (fine.vertices - fine.center_mm) @ rotation.T
    lift = world.table_normal @ world.table_point - (turned @ world.table_normal).min()
    target = np.array([0.0, 0.0, lift / world.table_normal[2]])
    pose = Pose.from_rotation_translation(rotation, target - rotation @ fine.center_mm)
    directions, irradiance = world.truth(target)
    names = tuple(f"flash_{index:03d}" for index in range(count))
    lights = Lights(names, directions, irradiance, positions, target)
    height = float(world.table_normal @ world.table_point)
    scene = Scene(fine, pose, camera, lights, unit(world.table_normal), height, 0.1, 0.15, SENSOR, 5)
    scan = scan_of(fine, rng, faces=faces, noise_mm=0.05, unscanned=rotation.T @ world.table_normal)
    motion = Pose.from_rotation_translation(random_rotation(rng), rng.uniform(-300, 300, 3))
    return scene, world, replace(scan, vertices=motion.apply(scan.vertices)), pose @ motion.inverse()


def _manifest(width: int, world: World) -> str:
    factor = width / CAMERA.width
    camera = CAMERA.scaled(width, width * 2 // 3, factor, factor)
    balls = "".join(f'[[spheres]]\nkind = "{ball.kind}"\ndiameter_mm = {2 * ball.radius}\n' for ball in world.balls)
    return (
        'version = 1\nname = "large"\n[frames]\nflash = "raw/flash_*.dng"\nambient = "raw/ambient_*.dng"\n[camera]\n'
        f"width = {camera.width}\nheight = {camera.height}\nfx = {camera.fx}\nfy = {camera.fy}\n"
        f"cx = {camera.cx}\ncy = {camera.cy}\n{balls}"
        '[object]\nscan = "scan/object.ply"\nscan_unit = "mm"\n'
    )


@dataclass(frozen=True)
class StepRow:
    """What one verb needed of a session."""

    session: str
    verb: str
    own_gb: float
    processor_s: float
    wall_s: float


def _cases(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [(0, 0, 0, "check")]
    if scale == "gates":
        return [(600, 4, 20_000, "check,calibrate,align,solve")]
    return [(6000, 5, 1_000_000, "check,calibrate,align,solve,twin,compare")]


def _measured(width: int, times: int, triangles: int, verbs: str) -> list[StepRow]:
    """Run verbs on a session of such photographs, each listed so many times; without a width on the fixture."""
    rows = []
    with tempfile.TemporaryDirectory() as place:
        folder, name = ROOT / "fixtures" / "bumpy", "the fixture"
        if width:
            folder = write_session(
                Path(place) / "session", width=width, flashes=FLASHES, faces=triangles, times=times
            ).parent
            name = f"{width**2 / 1.5e6:.2g} megapixels x {times * FLASHES}, {triangles:,} triangles"
        for verb in verbs.split(","):
            command = [Path(sys.executable).with_name("rgbn"), verb, folder, "--out", Path(place) / "out", "-q"]
            command += ["--error", TWIN_ERROR] if verb in ("twin", "compare") else []
            wall, processor, own = ran(command, limit_gb=LIMIT_GB)
            rows.append(StepRow(name, verb, own, processor, wall))
    return rows


def _shown(rows: Sequence[StepRow]) -> str:
    columns = {rows[0].session: "`rgbn {verb}`", "own memory, GB": "{own_gb:.2f}"}
    return markdown({**columns, "processor, s": "{processor_s:.0f}", "wall, s": "{wall_s:.0f}"}, rows)


def _figures(rows: Sequence[StepRow]) -> Figures:
    return {f"{row.verb}: {name}": getattr(row, name) for row in rows for name in ("own_gb", "processor_s")}


TABLES = (Table("robustness", "memory", ("lab.run",), StepRow, _cases, _measured, _shown, _figures, is_timed=True),)
