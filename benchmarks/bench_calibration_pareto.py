"""Calibration, speed against accuracy: one to five balls, four to a hundred frames; for docs/evidence/calibration.md.

    .venv/bin/python -m benchmarks.bench_calibration_pareto [--write] [--seeds 3]

Virtual sessions of 600 x 400 pixels with chrome balls: as in bench_calibrate, flashes 0.7 to 1.2 m from the object. Of
each session of 100 frames the first 4, 12, 36 are taken as sessions of their own. Seeds from 700 on.
"""

import argparse
import os
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.calibration_sessions import CAMERA, OBJECT, directions_to, reflection_points, world_peak
from benchmarks.pages import put
from calibrate.calibrate import calibrate
from compare.report.line_chart import line_chart
from fixtures.ball_scene import World, flashes, photograph
from scene.errors import SceneError
from scene.frames import Frames
from scene.normals import angular_error_deg
from twin.camera.virtual_camera import Sensor

DOCS = Path(__file__).resolve().parents[1] / "docs" / "evidence"
BALLS, FRAMES, FIRST_SEED = (1, 2, 3, 4, 5), (4, 12, 36, 100), 700
PLACES = ((-235, -105), (240, 115), (-230, 120), (235, -115), (0, 150))
SCALE = 0.5


def session(balls: int, seed: int) -> tuple[World, Frames]:
    """Return a world with some chrome balls of 67 px (at 1200 x 800) beside nothing else, and its 100 photographs."""
    rng = np.random.default_rng([seed, balls])
    lights = flashes(FRAMES[-1], near_mm=700, far_mm=1200, center=OBJECT, seed=int(rng.integers(1 << 31)))
    camera = CAMERA.scaled(600, 400, SCALE, SCALE)
    world = World(camera, [], lights, np.zeros((FRAMES[-1], 3)))
    world.table_texture, world.table_albedo = "wood", np.full(3, 0.2)
    world.table_second, world.table_half = 0.6 * world.table_albedo, 550.0
    world.ambient = np.full(3, 0.01)
    for x, y in PLACES[:balls]:
        dx, dy = rng.uniform(-20, 20, 2)
        world.stand("chrome", x + dx, y + dy, 67 * 1020.0 / CAMERA.fx)
    world.flash_radius = 25.0
    relative = rng.uniform(0.75, 1.3, (FRAMES[-1], 1)) * np.ones(3)
    world.powers = 0.7 * relative / max(float(world_peak(world, ball, relative)) for ball in world.balls)
    return world, photograph(world, Sensor(blur_px=0.6), rng)


def measured(world: World, frames: Frames, count: int) -> tuple[float, float] | str:
    """Return processor seconds and the median direction error, degrees, with the first frames; or why not."""
    some = Frames(frames.names[:count], frames.codes[:count], frames.gain[:count], is_mosaic=frames.is_mosaic)
    start = time.process_time()
    try:
        result = calibrate(some, world.camera, world.requests())
    except SceneError as error:
        return str(error)
    seconds, lights = time.process_time() - start, world.lights[:count]
    if len(world.balls) == 1:
        # One ball has no parallax: what it tells is the direction from where it shows the flash.
        true = directions_to(lights, reflection_points(world.camera, world.balls[0], lights))
        found = result.lights.directions
    else:
        true, found = directions_to(lights, OBJECT), result.lights.seen_from(OBJECT).directions
    return seconds, float(np.median(angular_error_deg(found, true)))


def main() -> None:
    """Measure, print, and with --write put the table and the chart into docs/evidence/calibration.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    import cv2

    cv2.setNumThreads(1)
    found: dict[tuple[int, int], list[tuple[float, float]]] = {}
    refused: list[str] = []
    for balls in BALLS:
        for seed in range(FIRST_SEED, FIRST_SEED + options.seeds):
            world, frames = session(balls, seed)
            if not found and not refused:
                # Compiles.
                measured(world, frames, FRAMES[0])
            for count in FRAMES:
                one = measured(world, frames, count)
                if isinstance(one, str):
                    refused.append(f"{balls} balls, {count} frames, seed {seed}: {one}")
                else:
                    found.setdefault((balls, count), []).append(one)
                print(balls, seed, count, one, flush=True)
    head = "| balls | " + " | ".join(f"{count} frames" for count in FRAMES) + " |"
    rows, lines = [head, "|---" * (len(FRAMES) + 1) + "|"], {}
    for balls in BALLS:
        fields = []
        for count in FRAMES:
            values = found.get((balls, count), [])
            middle = np.median(values, axis=0) if values else None
            some = f" ({len(values)} of {options.seeds})" if values and len(values) < options.seeds else ""
            fields.append("refused" if middle is None else f"{middle[0]:.1f} s, {middle[1]:.3f}°{some}")
        rows.append(f"| {balls} | " + " | ".join(fields) + " |")
        there = [np.median(found[balls, count], axis=0) for count in FRAMES if (balls, count) in found]
        if there:
            lines[f"{balls} ball{'s' * (balls > 1)}"] = ([x for x, _ in there], [y for _, y in there])
    text = "\n".join(rows) + (
        f"\n\nMedians over {options.seeds} sessions, seeds from {FIRST_SEED}: processor seconds of `calibrate` on "
        "decoded frames of 0.24 megapixels, median error of the directions at the object (one ball: at the ball). "
        "Where one was refused, the field says of how many the median is. "
        f"{len(refused)} of {len(BALLS) * len(FRAMES) * options.seeds} sessions were refused. Measured by "
        "`benchmarks/bench_calibration_pareto.py`.\n\n![Seconds against direction error](calibration-speed.svg)\n"
    )
    print(text, *refused, sep="\n")
    if options.write:
        chart = line_chart(
            lines, x_title="processor seconds", y_title="median direction error, °", log_x=True, log_y=True
        )
        (DOCS / "calibration-speed.svg").write_text(chart)
        put(DOCS / "calibration.md", "speed and accuracy", text)


if __name__ == "__main__":
    main()
