"""Fitted materials against known ones, and real photographs against their twin; written into docs/evidence/twin.md.

    .venv/bin/python -m benchmarks.bench_material [--write] [--seeds 10] [--parts material facets photographs ...]

Virtual sessions (benchmarks/material_sessions.py): shapes, roughness, strength, lights and textures of ten seeds; of
ten others, GGX and Beckmann in turn, each fitted with both. Real ones: DiLiGenT's ball and cat with the set's own
normals, their integral for the shadows; the University of Washington's gray ball as a sphere, its lights from the
chrome ball. Nothing was tuned on either.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from benchmarks.material_sessions import material_session
from benchmarks.pages import put
from benchmarks.real_captures import washington
from benchmarks.real_surfaces import diligent_object
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from twin.description.description import Sampling
from twin.description.materials import Distribution, RoughPlastic
from twin.engines.render import render_scene
from twin.material.fit_material import NAMES, MaterialFit, fit_material
from twin.material.material_kernels import predicted
from twin.material.material_residual import Residual
from twin.material.material_samples import Samples, samples_of_scan
from twin.material.scan_material import LEAST_PIXELS, scan_material
from twin.relighting import MASKS, relighting
from twin.visibility import Sight

ROOT = Path(__file__).resolve().parents[1]
BUNNY = ROOT.parent / "shared" / "sessions" / "bunny"
SHAPES = ("blob", "potato", "relief", "knot", "dented_pear", "house", "brick", "mug")
ROUGHNESSES = (0.05, 0.1, 0.2, 0.35, 0.5)
FACETS_FROM = 2000
"""First seed of the sessions of either distribution."""


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
            Sight.of_scan(session.scan, session.pose, session.camera, session.lights, session.normals),
            session.frames, session.mask,
        )  # fmt: skip
        spent = time.process_time() - start
        known = np.isfinite(found.albedo) & np.isfinite(session.albedo)
        error = found.albedo[known] / session.albedo[known] - 1
        fit, assumed = found.fit, (true.roughness, float(true.specularity))  # type: ignore[arg-type]
        wrong = fit.surface.roughness / assumed[0] - 1, fit.specularity / assumed[1] - 1, float(np.median(error))
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


def facets() -> list[str]:
    """Return the lines of sessions of either distribution: which is chosen, and what the other one would cost.

    The fit is given three lights of four; the photographs of the others are predicted.
    """
    lines = [
        "| session | shape | facets, roughness | chosen, by BIC | roughness found | with the other | specularity found "
        "| with the other | other lights, relative RMSE | with the other |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    off, right = [], 0
    cases: list[tuple[float, Distribution]] = [(roughness, name) for roughness in ROUGHNESSES for name in NAMES]
    for number, (roughness, name) in enumerate(cases):
        seed, shape = FACETS_FROM + number, SHAPES[number % len(SHAPES)]
        strength = float(np.random.default_rng([seed, 43]).uniform(0.25, 1.0))
        true = RoughPlastic((0.5, 0.5, 0.5), roughness, strength, distribution=name)
        session = material_session(seed, shape=shape, material=true, near=number % 3 != 0, height=240, depth=2)
        lights, given = session.lights, np.arange(len(session.lights)) % 4 != 0
        sight = Sight.of_scan(session.scan, session.pose, session.camera, lights, session.normals)
        every = samples_of_scan(sight, session.frames, session.mask, LEAST_PIXELS)
        every = every.only((every.usable & given).sum(1) >= 3)
        some = replace(every, usable=every.usable & given)
        fit = fit_material(some, lights)
        right += fit.surface.distribution == name
        both = fit, fit_material(some, lights, [other for other in NAMES if other != fit.surface.distribution])
        errors = [
            (one.surface.roughness / roughness - 1, one.specularity / strength - 1, _relit(every, some, one))
            for one in both
        ]
        off.append(errors)
        told = (f"{100 * one[k]:{sign}.1f} %" for k, sign in ((0, "+"), (1, "+"), (2, "")) for one in errors)
        lines.append(f"| {seed} | {shape} | {NAMES[name]}, {roughness} | {fit.evidence[1]} | {' | '.join(told)} |")
        print(lines[-1], flush=True)
    rms = 100 * np.sqrt(np.mean(np.square(off), 0))
    lines += [
        "",
        f"The right distribution is chosen in {right} of {len(cases)}.  ",
        *(
            f"{name}: {chosen:.1f} % off (rms) with the chosen distribution, {other:.1f} % with the other.  "
            for name, (chosen, other) in zip(("Roughness", "Specularity", "Light not given"), rms.T, strict=True)
        ),
    ]
    return lines


def _relit(every: Samples, some: Samples, fit: MaterialFit) -> float:
    """Return the relative RMSE of samples that are usable in `every` and not in `some`, to which a fit was made."""
    weights = np.repeat(some.usable[..., None], 3, -1).astype(np.float32)
    values, held = predicted(every, weights, fit.surface, fit.strength)[0], every.usable & ~some.usable
    return float(np.linalg.norm((every.values - values)[held]) / np.linalg.norm(every.values[held]))


def _words(fit: MaterialFit) -> str:
    if fit.model == "matte":
        return "matte"
    told, (_, facets, *also) = str(fit).split(":")[0], fit.evidence
    return f"{told} ({'; '.join([facets, *also])})"


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
    for name, sight, frames, mask in _captures():
        found = scan_material(sight, frames, mask)
        lines.append(_row(name, found.places.fits, found.residual))
    return lines


def relit() -> list[str]:
    """Return the lines of photographs under lights that the material was not fitted to."""
    kinds = ("linear", "hdr", "ldr")
    heads = ["photographs", *(f"{name}, relative RMSE" for name in MASKS), *(f"PSNR {kind}, dB" for kind in kinds)]
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    refined = ", normals refined"
    for name, sight, frames, mask in _captures():
        # How far off these normals are nobody states: the residuals alone bound the tilts.
        for sigma, words in ((None, ""), (np.full(mask.shape, 90, np.float32), refined)):
            found = relighting(
                sight, frames, mask, Sampling(error=0.01), lambda one: render_scene(one).frames, sigma_deg=sigma
            )
            lines.append(_scores(name + words, found.facts(), kinds))
    with tempfile.TemporaryDirectory() as out:
        rgbn = Path(sys.executable).with_name("rgbn")
        for verb, words in (("process", ""), ("twin", refined)):
            option = ["--refine-normals"] if words else []
            subprocess.run([rgbn, verb, BUNNY, "-o", out, "-q", *option], check=True)
            facts = json.loads(Path(out, "summary.json").read_text())["twin"]["held_out"]
            lines.append(_scores(f"bunny (another renderer's RAW){words}", facts, kinds))
    return [*lines, "", "In parentheses: each image, and each channel of it, scaled to suit best."]


def _scores(name: str, facts: dict[str, Any], kinds: Sequence[str]) -> str:
    shares = (
        f"{100 * facts[f'relative_rmse_{k}']:.1f} ({100 * facts[f'relative_rmse_{k}_scaled']:.1f}) %" for k in MASKS
    )
    decibels = (f"{facts[f'psnr_{k}_db']:.1f} ({facts[f'psnr_{k}_scaled_db']:.1f})" for k in kinds)
    count = f"{len(facts['fitted'])} frames fitted, {len(facts['predicted'])} foretold"
    row = f"| {name}, {count} | " + " | ".join([*shares, *decibels]) + " |"
    print(row, flush=True)
    return row


def _captures() -> Iterator[tuple[str, Sight, Frames, NDArray[np.bool_]]]:
    """Yield real captures whose shape is known: name, sight, frames, mask."""
    for name in ("ball", "cat"):
        one = diligent_object(name, "orthographic")
        yield f"DiLiGenT {name}", Sight(one.surface, one.camera, one.lights, one.normals), one.frames, one.mask
    gray = washington()
    pixels = gray.camera.grid()
    normals = gray.gray_ball.normals(gray.camera, pixels)[0].astype(np.float32)
    lights = gray.found.lights
    distant = Lights(lights.names, lights.directions, lights.intensities).normalised()
    sphere, ball = trimesh.creation.icosphere(subdivisions=5), gray.gray_ball
    # The ball's size is unknown: in the orthographic camera's unit it is what it is in pixels.
    unit = ball.radius_px / (ball.radius_mm * gray.camera.fx)
    surface = unit * (ball.radius_mm * np.array(sphere.vertices) + ball.center_mm(gray.camera))
    sight = Sight(Mesh(surface, np.array(sphere.faces)), gray.camera, distant, normals)
    yield "Washington gray ball", sight, gray.gray, gray.gray_ball.mask(gray.camera)


def main() -> None:
    """Measure, print, and with --write put the tables into docs/evidence/twin.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--parts", nargs="+", choices=("material", "facets", "photographs", "relighting"))
    arguments = parser.parse_args()
    parts = {"material": lambda: virtual(arguments.seeds), "facets": facets, "photographs": real, "relighting": relit}
    for name in arguments.parts or parts:
        text = "\n".join(parts[name]())
        text += f"\n\nMeasured on {os.cpu_count()} cores by `benchmarks/bench_material.py`.\n"
        print(text)
        if arguments.write:
            put(ROOT / "docs" / "evidence" / "twin.md", name, text)


if __name__ == "__main__":
    main()
