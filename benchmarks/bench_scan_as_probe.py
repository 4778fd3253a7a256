"""Lights by the scan alone: no ball, no light file; written into docs/evidence/calibration.md.

    .venv/bin/python -m benchmarks.bench_scan_as_probe [ROW ...] [--write]

Rows: virtual (six shapes of fixtures/mesh_shapes, seeds 6000 to 6005, untouched while the method was made), sessions
(the fixture and, where ../shared is, the bunny, their balls unlisted), real (DiLiGenT's cat and ball with the surfaces
of their given normals; Washington's gray ball with a sphere). Results are kept in out/bench_scan_as_probe.json, so that
rows can be run one by one; `--write` puts the tables of what is there into the document.
"""

import argparse
import json
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import rgbn
from align.light_probe.from_scan import ScanLights, lights_from_scan
from align.mask.object_mask import find_object
from align.pose.photographed import Photographs
from align.scan.smooth_normals import smooth_normals
from benchmarks.align_sessions import apart_px, session
from benchmarks.pages import put
from benchmarks.real_captures import washington
from benchmarks.real_surfaces import diligent_object, moved_scan
from fixtures.mesh_scene import random_rotation
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.rays import RayCaster

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "out" / "bench_scan_as_probe.json"
PAGE = ROOT / "docs" / "evidence" / "calibration.md"
SIZE = {"width": 960, "height": 640, "flashes": 16, "faces": 50_000}
SHAPES = ("blob", "potato", "relief", "knot", "mug", "dented_pear")
FIRST_SEED = 6000
SESSIONS = {"fixture": ROOT / "fixtures" / "bumpy", "bunny": ROOT / ".." / "shared" / "sessions" / "bunny"}
SHOTS = 32
"""Of DiLiGenT's 96."""
HEAD = (
    "| {} | lights | direction, median | worst | position, median | worst | intensity, median | worst | "
    "sigma of direction, stated | pose | seconds |\n|---|---|---|---|---|---|---|---|---|---|---|"
)


def asked(scan: Mesh, camera: Camera, frames: Frames, mask: np.ndarray) -> tuple[ScanLights, float]:
    """Return what the scan tells, and the seconds."""
    start = time.perf_counter()
    normals, sigma_deg = smooth_normals(scan)
    photographs = Photographs(camera, frames, Lights.unknown(frames.names), mask)
    found = lights_from_scan(RayCaster(scan, normals), sigma_deg, photographs)
    return found, time.perf_counter() - start


def off(found: Lights, truth: Lights) -> dict:
    """Return the errors of lights, as seen from the truth's reference point; of intensities the worst channel's."""
    seen = found.seen_from(truth.reference_point_mm)
    direction = angular_error_deg(seen.directions, truth.directions)
    intensity = 100 * np.abs(seen.intensities / truth.normalised().intensities - 1).max(1)
    row = {
        "model": found.model,
        "direction": [np.median(direction), direction.max()],
        "intensity": [np.median(intensity), intensity.max()],
        "sigma": np.median(found.direction_sigma_deg),
    }
    if seen.positions_mm is not None and truth.positions_mm is not None:
        far = np.linalg.norm(truth.positions_mm - truth.reference_point_mm, axis=1)
        place = 100 * np.linalg.norm(seen.positions_mm - truth.positions_mm, axis=1) / far
        row["position"] = [np.median(place), place.max()]
    return row


def virtual() -> dict:
    """Return a row for each shape."""
    rows = {}
    for seed, name in enumerate(SHAPES, FIRST_SEED):
        made = session(name, seed, **SIZE)
        camera = made.scene.camera
        found, seconds = asked(made.scan, camera, made.frames, find_object(made.frames, camera, []).mask)
        truth = made.scene.lights.seen_from(made.pose.apply(made.scan.center_mm))
        # As seen from the scan, wherever it is thought to be: that is what shading tells.
        shift, places = truth.reference_point_mm - found.lights.reference_point_mm, found.lights.positions_mm
        moved = None if places is None else places + shift
        lights = replace(found.lights, positions_mm=moved, reference_point_mm=truth.reference_point_mm)
        row = off(lights, truth) | {"pose": f"{apart_px(made.scene.camera, made.scan, found.pose, made.pose):.2f} px", "seconds": seconds}
        rows[f"{name}, gloss {made.scene.gloss:g}"] = row
        print(name, row, found.warnings[1:], flush=True)
    return rows


def sessions() -> dict:
    """Return a row for each session of known truth, its balls taken out of session.toml."""
    rows = {}
    for name, folder in SESSIONS.items():
        if not folder.is_dir():
            continue
        truth, maps = json.loads((folder / "truth.json").read_text()), np.load(folder / "truth.npz")
        with tempfile.TemporaryDirectory() as place:
            here = Path(place) / name
            here.mkdir()
            for part in ("raw", "scan"):
                (here / part).symlink_to((folder / part).resolve())
            parts = (folder / "session.toml").read_text().split("\n\n")
            kept = [part for part in parts if not part.startswith("[[spheres]]")]
            (here / "session.toml").write_text("spheres = []\n" + "\n\n".join(kept))
            start = time.perf_counter()
            opened = rgbn.open(here, out=Path(place) / "out").align()
            seconds, lights = time.perf_counter() - start, opened.lights
            pose = json.loads((Path(place) / "out" / "pose.json").read_text())["camera_from_scan"]
        turn = np.array(pose)[:3, :3] @ np.array(truth["camera_from_scan"])[:3, :3].T
        degrees = np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
        true = Lights(
            lights.names, np.array(truth["directions_at_object"]), np.array(truth["relative_intensity_rgb_at_object"]),
            maps["light_positions_mm"], np.array(truth["object_centre_mm"]),
        )  # fmt: skip
        rows[name] = off(lights, true) | {"pose": f"{degrees:.3f}°", "seconds": seconds}
        print(name, rows[name], flush=True)
    return rows


def real() -> dict:
    """Return a row for each real object of given shape."""
    rows = {}
    for name in ("cat", "ball"):
        made = diligent_object(name, "orthographic", shots=SHOTS)
        scan, pose = moved_scan(made.surface, 1)
        found, seconds = asked(scan, made.camera, made.frames, made.mask)
        turned = f"{(found.pose.inverse() @ pose).angle_deg():.2f}°" if name != "ball" else "free"
        rows[f"DiLiGenT, {name}"] = off(found.lights, made.lights) | {"pose": turned, "seconds": seconds}
        print(name, rows[f"DiLiGenT, {name}"], found.warnings[1:], flush=True)
    import trimesh

    lab = washington()
    sphere = trimesh.creation.icosphere(6)
    turn = random_rotation(np.random.default_rng(6))
    scan = Mesh(lab.gray_ball.radius_px * np.array(sphere.vertices) @ turn.T, np.array(sphere.faces, np.int64))
    mask = lab.gray_ball.mask(lab.camera)
    found, seconds = asked(scan, lab.camera, lab.gray, mask)
    for by, truth in (("its chrome ball", lab.found.lights), ("its lights.txt", lab.given)):
        row = off(found.lights, truth) | {"pose": "free", "seconds": seconds}
        if by == "its lights.txt":
            row["intensity"] = None
        rows[f"Washington, gray ball, by {by}"] = row
        print(by, row, flush=True)
    return rows


def table(head: str, rows: dict) -> str:
    """Return the rows as markdown."""

    def pair(values: list | None, form: str) -> str:
        return " | ".join(form.format(value) for value in values) if values else " | "

    lines = [HEAD.format(head)]
    for name, row in rows.items():
        cells = [
            name, row["model"], pair(row["direction"], "{:.2f}°"), pair(row.get("position"), "{:.1f} %"),
            pair(row["intensity"], "{:.2f} %"), f"{row['sigma']:.2f}°", row["pose"], f"{row['seconds']:.0f}",
        ]  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


HEADS = {"virtual": "virtual session", "sessions": "session, path-traced", "real": "photographs by others"}


def main() -> None:
    """Measure the rows asked for, keep them, and with --write put the tables into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="*", metavar="ROW")
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    kept = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    for name in arguments.rows:
        kept[name] = {"virtual": virtual, "sessions": sessions, "real": real}[name]()
        RESULTS.parent.mkdir(exist_ok=True)
        RESULTS.write_text(json.dumps(kept, default=float, indent=1))
    tables = [table(head, kept[name]) for name, head in HEADS.items() if name in kept]
    text = "\n\n".join([*tables, "Measured on 2 cores by `benchmarks/bench_scan_as_probe.py`.\n"])
    print(text)
    if arguments.write:
        put(PAGE, "scan as probe", text)


if __name__ == "__main__":
    main()
