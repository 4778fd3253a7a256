"""`semicalibrated` against `iterative` when the given intensities are wrong, written into docs/evidence/methods.md.

    .venv/bin/python -m benchmarks.bench_intensities [--write]

Sessions of the test scenes with shadows, gloss and noise, seeds 10101 to 10108, seen while the near lights'
depth was added; then DiLiGenT,
where ../shared is, its intensities right and all taken as one.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.pages import put
from fixtures import mesh_shapes
from fixtures.mesh_scene import Scene, Tracer, random_scene
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from solve.solve import solve

ROOT = Path(__file__).resolve().parents[1]
DILIGENT = ROOT / ".." / "shared" / "real" / "diligent"
SHAPES = {"potato": 16, "blob": 12, "pear": 24, "relief": 16, "gear": 24, "brick": 20, "mug": 12, "house": 20}
"""And how many flashes."""
WRONG = (0.0, 0.1, 0.2, 0.3)
METHODS = ("iterative", "semicalibrated")


def true_normals(scene: Scene) -> tuple[NDArray, NDArray[np.bool_]]:
    """Return the normals (H, W, 3) and where the object fills a pixel."""
    tracer = Tracer(scene)
    _, normals, _, on_object, weight, pixel = tracer.look()
    weighted = (weight[:, None] * normals)[on_object]
    total = np.stack([np.bincount(pixel[on_object], weighted[:, k], tracer.count) for k in range(3)], -1)
    total = total.reshape(*tracer.cover.shape, 3)
    mask = tracer.cover > 0.999
    return total / np.maximum(np.linalg.norm(total, axis=-1, keepdims=True), 1e-12), mask


def measure(scene: Scene, seed: int) -> tuple[NDArray, NDArray]:
    """Return mean errors in degrees (methods, WRONG), and the worst channel's rms error of the intensities (WRONG,)."""
    frames, lights = scene.photograph(), scene.lights
    normals, mask = true_normals(scene)
    random = np.random.default_rng([seed, 9])
    errors, off = np.zeros((len(METHODS), len(WRONG))), np.zeros(len(WRONG))
    for column, share in enumerate(WRONG):
        factor = np.exp(share * random.standard_normal((len(lights), 1)))
        given = replace(lights, intensities=lights.intensities * factor).normalised()
        for row, method in enumerate(METHODS):
            found = solve(method, frames, given, scene.camera, mask)
            errors[row, column] = np.nanmean(angular_error_deg(found.normals, normals)[mask])
            if found.lights is not None:
                there = found.lights.seen_from(lights.reference_point_mm).intensities
                off[column] = np.log(there / lights.intensities).std(0).max()
    return errors, off


def session(seed: int, shape: str, flashes: int, farther: float) -> Scene:
    """Return a test scene, its flashes so many times farther away."""
    scene = random_scene(getattr(mesh_shapes, shape)(), seed, width=360, height=240, flashes=flashes)
    lights = scene.lights
    assert lights.positions_mm is not None
    arm = lights.positions_mm - lights.reference_point_mm
    return replace(scene, lights=replace(lights, positions_mm=lights.reference_point_mm + farther * arm))


def diligent(name: str) -> str:
    """Return the table's lines of one of DiLiGenT's objects."""
    import cv2
    import scipy.io

    from scene.camera import Camera

    folder = DILIGENT / name
    files = (folder / "filenames.txt").read_text().split()

    def picture(name: str, how: int) -> NDArray:
        image = cv2.imread(str(folder / name), how)
        assert image is not None, name
        return image

    images = np.stack([picture(file, cv2.IMREAD_UNCHANGED)[..., ::-1] for file in files]) / 65535.0
    names = tuple(Path(file).stem for file in files)
    directions, strengths = (np.loadtxt(folder / f"light_{what}.txt") for what in ("directions", "intensities"))
    lights = Lights(names, directions, strengths).normalised()
    mask = picture("mask.png", cv2.IMREAD_GRAYSCALE) > 127
    normals = scipy.io.loadmat(folder / "Normal_gt.mat")["Normal_gt"]
    frames = Frames.from_linear(names, images)
    camera = Camera(mask.shape[1], mask.shape[0], 1.0, 1.0, 0.0, 0.0, projection="orthographic")
    lines = ""
    for method in METHODS:
        for what, given in (("given", lights), ("all one", replace(lights, intensities=np.ones_like(strengths)))):
            found = solve(method, frames, given, camera, mask)
            error = np.nanmean(angular_error_deg(found.normals, normals)[mask])
            off = "" if found.lights is None else f"{np.log(found.lights.intensities / strengths).std(0).max():.1%}"
            lines += f"| {name.removesuffix('PNG')} | `{method}` | {what} | {error:.2f} | {off} |\n"
    return lines


def main() -> None:
    """Measure, print, and with --write put the tables into docs/evidence/methods.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    text = "| lights | method | right | 10 % | 20 % | 30 % | intensities off, rms |\n|---|---|---|---|---|---|---|\n"
    for lights, farther in (("10 to 18 m away", 20.0), ("0.5 to 0.9 m away", 1.0)):
        done = [
            measure(session(10101 + k, shape, flashes, farther), 10101 + k)
            for k, (shape, flashes) in enumerate(SHAPES.items())
        ]
        errors, off = (np.array(part) for part in zip(*done, strict=True))
        for row, method in enumerate(METHODS):
            cells = " | ".join(f"{value:.2f}" for value in errors[:, row].mean(0))
            told = f"{off.min():.1%} to {off.max():.1%}" if method == "semicalibrated" else ""
            text += f"| {lights} | `{method}` | {cells} | {told} |\n"
    if DILIGENT.is_dir():
        text += "\n| DiLiGenT | method | intensities | mean, degrees | intensities off, rms |\n|---|---|---|---|---|\n"
        text += diligent("ballPNG") + diligent("catPNG")
    print(text)
    if arguments.write:
        path = ROOT / "docs" / "evidence" / "methods.md"
        put(path, "intensities", text)


if __name__ == "__main__":
    main()
