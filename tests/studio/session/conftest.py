"""Output folders to be looked at, of known truth or made by the command line; a folder without a session."""

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from calibrate.lights.directions import mirrored_at
from fixtures.lit_surfaces import flashes_at
from formats.meshes.scan_files import write_mesh
from lab.run import run_session
from scene.camera import Camera
from scene.files import write_json
from scene.frames import Frames
from scene.mesh import Mesh
from scene.output_folder import open_record
from scene.pose import Pose, rotation_from_vector
from scene.spheres import Sphere
from scene.store import Store
from tests.conftest import FIXTURE
from twin.description.object_mesh import built_in

CAMERA = Camera(160, 120, 220.0, 220.0, 78.0, 61.0)
REFERENCE = np.array([4.0, -3.0, -800.0])
WARNING = "flash_2: the white ball stands in shadow; look at the frame."


def near_lights(count=5):
    generator = np.random.default_rng(10_001)
    positions = REFERENCE + generator.uniform([-500, -500, 500], [500, 500, 900], (count, 3))
    more = {"digits": 1, "direction_sigma_deg": np.full(count, 0.4), "intensity_sigma": np.full(count, 0.01)}
    flags = ((), (), (), ("no highlight seen",), ())
    intensities = generator.uniform(0.7, 1.3, (count, 3))
    return flashes_at(positions, REFERENCE, intensities, white_value=np.ones(3), flags=flags, **more).normalised()


def balls():
    return [
        Sphere("chrome", np.array([30.0, 28.0]), 14.0, 100.0, 0.02),
        Sphere("chrome", np.array([132.0, 90.0]), 13.0, 100.0, 0.03),
        Sphere("white", np.array([26.0, 92.0]), 12.0, 90.0, 0.02),
    ]


def object_normals():
    """A ball's normals in the middle of the picture, NaN elsewhere."""
    normals, _ = Sphere("white", np.array([80.0, 60.0]), 30.0, 200.0).normals(
        CAMERA, np.stack(np.meshgrid(np.arange(160), np.arange(120)), -1)
    )
    return normals.astype(np.float32)


def note_steps(record, steps):
    for name, entry in steps.items():
        with record.making(name, "by the test") as kept:
            kept |= entry


@pytest.fixture(scope="session")
def whole(tmp_path_factory):
    """A whole output folder: every frame of a colour of its own, one of them clipped in a known block."""
    root = tmp_path_factory.mktemp("whole")
    store, lights, truth = Store(root / "out"), near_lights(), object_normals()
    with open_record(store.folder) as record:
        mask = np.isfinite(truth[..., 0])
        generator = np.random.default_rng(10_002)
        colours = generator.uniform(0.05, 0.25, (5, 3))
        linear = np.broadcast_to(colours[:, None, None], (5, 120, 160, 3)).copy()
        shade = np.nan_to_num(np.maximum(truth @ lights.directions.T, 0))  # (H, W, N)
        linear += 0.4 * (shade.transpose(2, 0, 1)[..., None] * mask[..., None])
        linear[1, 100:110, 60:80] = 1.2
        frames = Frames.from_linear(lights.names, linear)
        store.save_frames(frames)
        store.save_camera(CAMERA)
        Store(store.path("frames")).save_camera(CAMERA)
        store.save_spheres(balls(), CAMERA)
        store.save_lights(lights)
        store.save_mask(mask)
        store.save_truth(truth, np.where(mask, 0.5, np.nan))
        pose = Pose.from_rotation_translation(rotation_from_vector(np.array([0.2, 0.3, 0.1])), REFERENCE)
        store.save_pose(pose, residual_px=0.1, sigma_mm=0.2, sigma_deg=0.05)
        Store(store.path("twin")).save_frames(Frames.from_linear(lights.names, 0.9 * linear))
        highlights = np.array([mirrored_at(CAMERA, ball, lambda points: lights.directions) for ball in balls()])
        highlights[0, 3] = highlights[2] = np.nan
        write_json(
            store.path("calibration.json"),
            {"highlights_px": highlights, "rejected": []},
        )
        rows = [
            {"name": name, "saturated_share": 200 / 19200 if i == 1 else 0.0} for i, name in enumerate(lights.names)
        ]
        steps = {name: {"warnings": [], "result": {}} for name in ("check", "calibrate", "align", "solve", "twin")}
        steps["check"]["result"] = {"frames_table": rows}
        steps["calibrate"]["warnings"] = [WARNING]
        note_steps(record, steps)
    session = root / "session"
    (session / "raw").mkdir(parents=True)
    for name in lights.names:
        (session / "raw" / f"{name}.png").write_bytes(b"")
    cone = built_in("cone")
    write_mesh(session / "cone.ply", Mesh(cone.vertices * [40, 40, 90], cone.faces))
    (session / "session.toml").write_text(
        '[frames]\nflash = "raw/flash_*.png"\nlinear = true\n[camera]\nwidth = 160\nheight = 120\nfx = 220.0\n'
        'fy = 220.0\ncx = 78.0\ncy = 61.0\n[[spheres]]\nkind = "chrome"\ndiameter_mm = 100.0\n[[spheres]]\n'
        'kind = "chrome"\ndiameter_mm = 100.0\n[[spheres]]\nkind = "white"\ndiameter_mm = 90.0\n'
        '[object]\nscan = "cone.ply"\n'
    )
    return root, {"lights": lights, "camera": CAMERA, "mask": mask, "truth": truth, "linear": linear, "pose": pose}


@pytest.fixture
def made(whole, tmp_path):
    """A copy of the whole folder and of its session, to be changed; and what is known of both."""
    root, known = whole
    out, session = (Path(shutil.copytree(root / name, tmp_path / name)) for name in ("out", "session"))
    return SimpleNamespace(folder=out, store=Store(out), session=session, **known)


@pytest.fixture(scope="session")
def calibrated(tmp_path_factory):
    """The fixture with one ball at half size, calibrated by the command line: no mask, no scan, no twin yet."""
    root = tmp_path_factory.mktemp("review")
    text = (FIXTURE / "session.toml").read_text()
    flash = json.dumps([str(path) for path in sorted((FIXTURE / "raw").glob("flash_*.dng"))[::2]])
    text = text.replace('"raw/flash_*.dng"', flash + "\nhalf = true")
    head, ball, rest = text.partition("[[spheres]]")
    text = head + ball + '\nkind = "chrome"\ndiameter_mm = 100.0\n\n' + rest[rest.index("[object]") :]
    for key in ("raw/ambient_*.dng", "scan/object.ply"):
        text = text.replace(f'"{key}"', json.dumps(str(FIXTURE / key)))
    (root / "session").mkdir()
    (root / "session" / "session.toml").write_text(text)
    run_session(root / "session", "calibrate", out=root / "out")
    return SimpleNamespace(root=root, folder=root / "out", session=root / "session", text=text)
