"""Fitted materials against known ones, and real photographs against their twin; written into docs/evidence/twin.md.

    .venv/bin/python -m benchmarks.bench_material [--write] [--seeds 10]

Virtual sessions (benchmarks/material_sessions.py): shapes, roughness, strength, lights and textures of ten seeds. Real
ones: DiLiGenT's ball and cat with the set's own normals, their integral for the shadows; the University of Washington's
gray ball as a sphere, its lights from the chrome ball. Nothing was tuned on either.
"""

import argparse
import os
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.material_sessions import material_session
from benchmarks.pages import put
from benchmarks.real_captures import washington
from benchmarks.real_surfaces import diligent_object
from scene.lights import Lights
from scene.mesh import Mesh
from twin.description.materials import RoughPlastic
from twin.description.object_mesh import built_in
from twin.material.fit_material import MaterialFit, fit_material
from twin.material.material_residual import Residual, material_residual
from twin.material.material_samples import samples_of_scan
from twin.material.scan_material import scan_material
from twin.visibility import Sight

ROOT = Path(__file__).resolve().parents[1]
SHAPES = ("blob", "potato", "relief", "knot", "dented_pear", "house", "brick", "mug")


def virtual(seeds: int) -> list[str]:
    """Return the lines of the virtual sessions."""
    lines = [
        "| session | shape | lights | roughness | found | specularity | found | albedo, median | of a pixel | "
        "relative RMSE | processor, s |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    off = []
    for seed in range(seeds):
        generator = np.random.default_rng([seed, 43])
        shape, near = SHAPES[seed % len(SHAPES)], seed % 3 != 0
        true = RoughPlastic((0.5, 0.5, 0.5), float(generator.uniform(0.1, 0.6)), float(generator.uniform(0.25, 1.0)))
        session = material_session(seed, shape=shape, material=true, near=near)
        start = time.process_time()
        found = scan_material(
            Sight.of_scan(session.scan, session.pose, session.camera, session.lights), session.frames, session.mask,
            session.normals,
        )  # fmt: skip
        spent = time.process_time() - start
        known = np.isfinite(found.albedo) & np.isfinite(session.albedo)
        error = found.albedo[known] / session.albedo[known] - 1
        fit, assumed = found.fit, (true.roughness, float(true.specularity))  # type: ignore[arg-type]
        wrong = fit.roughness / assumed[0] - 1, fit.specularity / assumed[1] - 1, float(np.median(error))
        off.append(wrong)
        what = f"{shape}, two places" if len(found.places.fits) > 1 else shape
        lines.append(
            f"| {seed} | {what} | {'near' if near else 'distant'} | {assumed[0]:.3f} | {100 * wrong[0]:+.1f} % | "
            f"{assumed[1]:.3f} | {100 * wrong[1]:+.1f} % | {100 * wrong[2]:+.1f} % | "
            f"{100 * np.median(np.abs(error)):.1f} % | {100 * found.residual.whole:.2f} % | {spent:.0f} |"
        )
        print(lines[-1], flush=True)
    rms, worst = np.sqrt(np.mean(np.square(off), 0)), np.max(np.abs(off), 0)
    lines += [
        "",
        *(
            f"{name}: {100 * r:.1f} % off (rms), {100 * w:.1f} % at worst.  "
            for name, r, w in zip(("Roughness", "Specularity", "Albedo"), rms, worst, strict=True)
        ),
    ]
    return lines


def _words(fit: MaterialFit) -> str:
    if fit.model == "matte":
        return "matte"
    bare = "" if fit.covered == 1 else f", dimming {100 * fit.covered:.0f} %"
    return f"{fit.model}, roughness {fit.roughness:.3f}{bare}"


def _row(name: str, fits: Sequence[MaterialFit], left: Residual) -> str:
    parts = ", ".join(f"{key} {100 * part.explains:.0f} %" for key, part in left.parts.items())
    frames = left.per_frame[np.isfinite(left.per_frame)]
    row = (
        f"| {name} | {'; and '.join(map(_words, fits))} | "
        f"**{100 * left.whole:.1f} %** | {100 * frames.min():.1f} to {100 * frames.max():.1f} % | {parts} |"
    )
    print(row, flush=True)
    return row


def real() -> list[str]:
    """Return the lines of the real photographs."""
    lines = [
        "| photographs | model | relative RMSE | of single frames | of its square, each alone would explain |",
        "|---|---|---|---|---|",
    ]
    for name in ("ball", "cat"):
        one = diligent_object(name, "orthographic")
        found = scan_material(Sight(one.surface, one.camera, one.lights), one.frames, one.mask, one.normals)
        lines.append(_row(f"DiLiGenT {name}, 96 lights", found.places.fits, found.residual))
    gray = washington()
    pixels = gray.camera.grid()
    normals = gray.gray_ball.normals(gray.camera, pixels)[0].astype(np.float32)
    lights = gray.found.lights
    distant = Lights(lights.names, lights.directions, lights.intensities).normalised()
    sphere, middle = built_in("sphere"), gray.gray_ball.center_mm(gray.camera)
    sight = Sight(Mesh(gray.gray_ball.radius_mm * sphere.vertices + middle, sphere.faces), gray.camera, distant)
    samples = samples_of_scan(sight, gray.gray, gray.gray_ball.mask(gray.camera), normals)
    fit = fit_material(samples, distant)
    lines.append(_row("Washington gray ball, 12 lights", (fit,), material_residual(samples, fit, distant)))
    return lines


def main() -> None:
    """Measure, print, and with --write put the tables into docs/evidence/twin.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--seeds", type=int, default=10)
    arguments = parser.parse_args()
    text = "\n".join([*virtual(arguments.seeds), "", *real()])
    text += f"\n\nMeasured on {os.cpu_count()} cores by `benchmarks/bench_material.py`.\n"
    print(text)
    if arguments.write:
        path = ROOT / "docs" / "evidence" / "twin.md"
        put(path, "material", text)


if __name__ == "__main__":
    main()
