"""Find balls and lights in scenes by somebody else's renderer; written into docs/evidence/calibration.md.

    .venv/bin/python -m benchmarks.bench_ball_scenes FOLDER [--jobs 2] [--write]

FOLDER holds scenes as benchmarks/their_scenes.py reads them. What was missed or taken wrongly is drawn into
out/ball_scenes.png.
"""

import argparse
import time
from collections import defaultdict
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.pages import folded, put
from benchmarks.their_scenes import is_same, opened, read_truth, scenes_in
from scene.normals import angular_error_deg, unit
from scene.spheres import Sphere

ROOT = Path(__file__).resolve().parents[1]
PAGE, SHEET = ROOT / "docs" / "evidence" / "calibration.md", ROOT / "out" / "ball_scenes.png"
INSIDE, OFF_DEG = 2.448, 1.0  # sigmas of the 95 % region in a plane; and when lights are called off
SIDE_PX = 128  # of a picture in the contact sheet
MISSED, FALSE = (80, 80, 255), (0, 220, 255)  # circles in it, BGR


def examine(scene: Path, mode: str) -> dict[str, Any]:
    """Calibrate one session and hold it against its truth."""
    from calibrate.calibrate import calibrate
    from scene.errors import SceneError

    truth, true = read_truth(scene)
    row: dict[str, Any] = {"scene": scene.name, "mode": mode, "table": truth["table"], "room": truth["room"]}
    with opened(scene, mode) as (frames, camera, requests):
        start = time.process_time()
        try:
            found = calibrate(frames, camera, requests)
        except SceneError as error:
            return row | {"refused": str(error), "balls": [_ball(one, None) for one in true], "false": []}
        row["seconds"] = time.process_time() - start
    left = list(found.spheres)
    balls = []
    for one in true:
        match = next((s for s in left if is_same(s, one)), None)
        left = [s for s in left if s is not match]
        balls.append(_ball(one, match))
    row |= {"balls": balls, "false": [{"kind": s.kind, "at": list(s.center_px), "radius": s.radius_px} for s in left]}
    row["warnings"] = len(found.warnings)
    if mode == "asked":
        lights = found.lights
        toward = unit(np.array(truth["light_positions_mm"]) - lights.reference_point_mm)
        error = angular_error_deg(toward, lights.directions)
        row |= {"error": float(np.median(error)), "sigma": float(np.median(lights.direction_sigma_deg))}
        row["inside"] = float(np.mean(error < INSIDE * lights.direction_sigma_deg))
    return row


def _ball(one: Sphere, match: Sphere | None) -> dict[str, Any]:
    ball = {"kind": one.kind, "at": list(one.center_px), "radius": one.radius_px, "found": match is not None}
    if match is not None:
        ball |= {"off": match.radius_px - one.radius_px, "sigma": match.sigma_px}
    return ball


def tables(rows: list[dict]) -> str:
    """Return the page's text."""
    lines = ["|  | asked for | not asked for |", "|---|---|---|"]
    groups: dict[str, dict[str, list[dict]]] = defaultdict(lambda: {"asked": [], "unasked": []})
    false = {mode: sum(len(row["false"]) for row in rows if row["mode"] == mode) for mode in ("asked", "unasked")}
    for row in rows:
        for ball in row["balls"]:
            size = "under 20 px" if ball["radius"] < 20 else "20 to 40 px" if ball["radius"] < 40 else "over 40 px"
            for name in ("all balls", f"table: {row['table']}", f"room: {row['room']}", f"{ball['kind']}, {size}"):
                groups[name][row["mode"]].append(ball)
    for name in sorted(groups, key=lambda name: (name != "all balls", name)):
        cells = [f"{sum(b['found'] for b in some)} of {len(some)}" for some in groups[name].values()]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    scenes = len({row["scene"] for row in rows})
    lines += [f"| false circles in {scenes} scenes | {false['asked']} | {false['unasked']} |", ""]
    return "\n".join([*lines, *_lights(rows), ""])


def _lights(rows: list[dict]) -> Iterable[str]:
    asked = [row for row in rows if row["mode"] == "asked"]
    lit = [row for row in asked if "error" in row]
    off = [row for row in lit if row["error"] > max(OFF_DEG, 2 * row["sigma"])]
    found = [b for row in asked for b in row["balls"] if b["found"]]
    pulls = np.array([b["off"] / b["sigma"] for b in found])
    silent = sum(not row["warnings"] for row in off)
    errors, inside = np.median([row["error"] for row in lit]), np.mean([row["inside"] for row in lit])
    yield (
        f"Asked for: {len(asked) - len(lit)} of {len(asked)} sessions refused; lights off by more than {OFF_DEG:g} "
        f"degree and twice their sigma in {len(off)} ({silent} of them without a warning), median {errors:.2f} "
        f"degrees; {inside:.0%} of the lights inside their 95 % region. Radius: median "
        f"{np.median([b['off'] for b in found]):+.3f} px, {np.mean(np.abs(pulls) < 2):.0%} within two sigmas. "
        f"{np.median([row['seconds'] for row in lit]):.0f} processor seconds a session (median)."
    )
    yield ""
    yield from folded("The scenes in which something was wrong", _wrong(asked, off))


def _wrong(asked: list[dict], off: list[dict]) -> Iterable[str]:
    for row in asked:
        missed = [f"{b['kind']} of {b['radius']:.0f} px missed" for b in row["balls"] if not b["found"]]
        wrong = [f"{b['kind']} of {b['radius']:.0f} px false" for b in row["false"]]
        said = [f"refused: {row['refused']}"] if "refused" in row else missed + wrong
        if row in off:
            said.append(f"lights off by {row['error']:.1f} degrees, sigma {row['sigma']:.1f}")
        if said:
            yield f"{row['scene']} ({row['table']}, {row['room']}): {'; '.join(said)}"


def draw(rows: list[dict], folder: Path) -> None:
    """Draw every ball that was missed (red) and every false circle (yellow), in the mean of the photographs."""
    tiles = []
    for row in rows:
        wrong = [(b, (80, 80, 255)) for b in row["balls"] if not b["found"]] + [
            (b, (0, 220, 255)) for b in row["false"]
        ]
        if not wrong:
            continue
        paths = sorted((folder / row["scene"] / row["mode"]).glob("flash_*.png"))
        mean = np.mean([np.asarray(cv2.imread(str(p)), np.float32) for p in paths], axis=0)
        shown = np.clip(255 * (mean / max(float(np.percentile(mean, 99)), 1)) ** 0.45, 0, 255).astype(np.uint8)
        for ball, colour in wrong:
            half = 2 * ball["radius"]
            scale = SIDE_PX / (2 * half)
            shift = np.array([[scale, 0, -scale * (ball["at"][0] - half)], [0, scale, -scale * (ball["at"][1] - half)]])
            tile = cv2.warpAffine(shown, shift, (SIDE_PX, SIDE_PX), flags=cv2.INTER_LINEAR)
            cv2.circle(tile, (SIDE_PX // 2, SIDE_PX // 2), SIDE_PX // 4, colour, 1, cv2.LINE_AA)
            text = f"{row['scene'][6:]} {row['mode'][:2]} {ball['kind'][0]}{ball['radius']:.0f}"
            cv2.putText(tile, text, (3, 12), cv2.FONT_HERSHEY_SIMPLEX, 0.38, (255, 255, 255), 1, cv2.LINE_AA)
            tiles.append(tile)
    if tiles:
        tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % 8)
        sheet = np.vstack([np.hstack(tiles[i : i + 8]) for i in range(0, len(tiles), 8)])
        SHEET.parent.mkdir(exist_ok=True)
        cv2.imwrite(str(SHEET), sheet)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    scenes = scenes_in(args.folder)
    jobs = [(scene, mode) for scene in scenes for mode in ("asked", "unasked")]
    rows = []
    with ProcessPoolExecutor(args.jobs) as pool:
        for row in pool.map(examine, *zip(*jobs, strict=True)):
            rows.append(row)
            found = sum(b["found"] for b in row["balls"])
            print(row["scene"], row["mode"], f"{found} of {len(row['balls'])}, {len(row['false'])} false", flush=True)
    text = f"Seeds {scenes[0].name[6:]} to {scenes[-1].name[6:]}.\n\n{tables(rows)}"
    print(text)
    draw(rows, args.folder)
    if args.write:
        put(PAGE, "ball scenes", text)


if __name__ == "__main__":
    main()
