"""From photographs alone to lights, in scenes by somebody else's renderer; written into docs/evidence/first-capture.md.

    .venv/bin/python -m benchmarks.bench_init FOLDER [--write]

FOLDER holds scenes as benchmarks/their_scenes.py reads them. Of each the photographs are taken under names that tell
nothing, without session.toml. `rgbn init` looks at them; a ball that it found gets its true diameter, as a person would
give it; and the lights are found with the true camera, with none (the balls tell the focal length), and with an
orthographic one. Directions are those from the middle of the balls.
"""

import argparse
import shutil
import tempfile
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.pages import folded, put
from benchmarks.their_scenes import is_same, read_truth, scenes_in
from capture.session.session_types import Lens
from capture.survey.folder_files import survey
from lab.init.answers import Answers, Asking
from lab.init.draft import Draft, DraftBall
from lab.init.prepare import prepare
from lab.init.session_text import session_text
from lab.run import run_session
from scene.errors import SceneError
from scene.normals import angular_error_deg, unit
from scene.spheres import Sphere
from scene.store import Store

PAGE = Path(__file__).resolve().parents[1] / "docs" / "evidence" / "first-capture.md"
KINDS = ("known", "by the balls", "orthographic")


def examine(scene: Path, place: Path) -> dict[str, Any]:
    """Describe one scene's folder, and find its lights with each camera."""
    truth, true = read_truth(scene)
    folder = place / "capture"
    folder.mkdir()
    pictures = sorted((scene / "unasked").glob("*.png"))
    for number, path in enumerate(pictures):
        shutil.copy(path, folder / f"IMG_{100 + number}.png")
    ambient = {f"IMG_{100 + n}.png" for n, path in enumerate(pictures) if path.name.startswith("ambient")}
    start = time.process_time()
    draft = prepare(survey(folder)[0], Asking(Answers(linear=True), silent=True))
    row: dict[str, Any] = {"scene": scene.name, "seconds": time.process_time() - start, "true": len(true)}
    row["roles"] = {path.name for path in draft.photographs.get("ambient", [])} == ambient
    balls = [replace(ball, diameter_mm=_diameter(ball, true)) for ball in draft.balls]
    row["found"] = sum(ball.diameter_mm is not None for ball in balls)
    row["false"] = len(balls) - row["found"]
    draft = replace(draft, balls=tuple(balls))
    known = Lens(fx=truth["fx"], cx=truth["cx"], cy=truth["cy"])
    row["focal"] = truth["fx"]
    row["known"] = _lights(replace(draft, lens=known), truth, place / "known")
    row["by the balls"] = _lights(draft, truth, place / "unknown")
    # Without diameters nothing asks for the focal length.
    bare = replace(draft, balls=tuple(replace(ball, diameter_mm=None) for ball in balls))
    row["orthographic"] = _lights(bare, truth, place / "orthographic")
    return row


def _diameter(ball: DraftBall, true: list[Sphere]) -> float | None:
    found = Sphere(ball.kind, np.array(ball.center_px), ball.radius_px)
    return next((one.diameter_mm for one in true if is_same(found, one)), None)


def _lights(draft: Draft, truth: dict[str, Any], out: Path) -> dict[str, Any]:
    """Calibrate, and hold the lights' directions against the truth, seen from where they hold."""
    (draft.folder / "session.toml").write_text(session_text(draft))
    try:
        run_session(draft.folder, "calibrate", out=out)
    except SceneError as error:
        return {"refused": str(error).splitlines()[0]}
    lights, camera = Store(out).load_lights(), Store(out).load_camera()
    middle = np.mean([one["centre_mm"] for one in truth["spheres"]], axis=0)
    toward = unit(np.array(truth["light_positions_mm"]) - middle)
    if lights.positions_mm is not None:
        # The same point among the balls: what a focal length scales is the depth.
        lights = lights.seen_from(middle * [1, 1, camera.fx / truth["fx"]])
    error = angular_error_deg(toward, lights.directions)
    sigma = float(np.median(lights.direction_sigma_deg))
    return {"error": float(np.median(error)), "sigma": sigma, "fx": camera.fx, "focal_sigma": camera.focal_sigma,
            "source": camera.source}  # fmt: skip


def page(rows: list[dict[str, Any]]) -> str:
    """Return the page's text."""
    count, true = len(rows), sum(row["true"] for row in rows)
    lines = [
        f"{count} scenes, {rows[0]['scene']} to {rows[-1]['scene']}. The ambient frame was told from the others in "
        f"{sum(row['roles'] for row in rows)}; {sum(row['found'] for row in rows)} of {true} balls were found, "
        f"{sum(row['false'] for row in rows)} circles were none. "
        f"{np.median([row['seconds'] for row in rows]):.0f} processor seconds a folder (median).",
        "",
        "| camera | lights found | direction, median of scenes | worst scene |",
        "|---|---|---|---|",
    ]
    for kind in KINDS:
        some = [row[kind] for row in rows if "error" in row[kind]]
        if kind == "by the balls":
            some = [one for one in some if one["source"] == "balls"]
        errors = [one["error"] for one in some] or [np.nan]
        lines.append(f"| {kind} | {len(some)} | {np.median(errors):.2f}° | {np.max(errors):.1f}° |")
    told = [(row, row["by the balls"]) for row in rows if row["by the balls"].get("source") == "balls"]
    off = np.array([one["fx"] / row["focal"] - 1 for row, one in told])
    sigma = np.array([one["focal_sigma"] for _, one in told])
    lines += [
        "",
        f"Focal length by the balls: told in {len(told)} of {count}; median error {100 * np.median(abs(off)):.1f} %, "
        f"worst {100 * abs(off).max():.0f} %; {np.mean(abs(off) < 2 * sigma):.0%} within two sigmas.",
        "",
        *folded("Scene by scene", _each(rows)),
    ]
    return "\n".join([*lines, ""])


def _each(rows: list[dict[str, Any]]) -> Iterable[str]:
    for row in rows:
        said = [f"{row['found']} of {row['true']} balls, {row['false']} false"]
        for kind in KINDS:
            one = row[kind]
            if "refused" in one:
                said.append(f"{kind}: refused, {one['refused']}")
            elif kind == "by the balls" and one["source"] == "balls":
                off, sigma = 100 * (one["fx"] / row["focal"] - 1), 100 * one["focal_sigma"]
                said.append(f"{kind}: {one['error']:.2f}°, focal length {off:+.1f} % (sigma {sigma:.1f} %)")
            else:
                said.append(f"{kind}: {one['error']:.2f}°")
        yield f"{row['scene']}: {'; '.join(said)}"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--write", action="store_true")
    said = parser.parse_args()
    rows = []
    for scene in scenes_in(said.folder):
        with tempfile.TemporaryDirectory() as place:
            rows.append(examine(scene, Path(place)))
        print(rows[-1], flush=True)
    text = page(rows)
    print(text)
    if said.write:
        put(PAGE, "init", text)


if __name__ == "__main__":
    main()
