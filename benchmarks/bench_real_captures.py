"""Calibrate the real captures and write docs/evidence/real-captures.md, table and pictures.

    .venv/bin/python -m benchmarks.bench_real_captures [--write]

The captures lie beside the repository, in ../shared. The pictures are drawn from what was measured; none shows a
photograph.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.real_captures import REAL, MatteBall, bunny, columbia, diligent_ball, explain, mask_circle, washington
from scene.files import write_png
from scene.normals import angular_error_deg
from scene.spheres import Sphere

DOCS = Path(__file__).resolve().parents[1] / "docs" / "evidence"
PANEL = 300
INK, BLUE, RED, GRID = (40, 40, 40), (31, 119, 180), (214, 39, 40), (205, 205, 205)


def panel(title: str) -> np.ndarray:
    """Return an empty picture with a title."""
    image = np.full((PANEL + 30, PANEL, 3), 255, np.uint8)
    return write(image, title, (8, 20))


def write(image: np.ndarray, text: str, at: tuple[int, int], colour=INK) -> np.ndarray:
    import cv2

    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.42, colour, 1, cv2.LINE_AA)
    return image


def draw_ball(title: str, ball: Sphere, points: np.ndarray, mask: tuple[float, float, float]) -> np.ndarray:
    """Draw a found outline, the set's mask as a circle, and the highlights."""
    import cv2

    image, scale = panel(title), (PANEL - 60) / (2 * ball.radius_px)

    def place(pixel):
        return tuple(int(x) for x in np.round((np.asarray(pixel) - ball.center_px) * scale * 16 + [2400, 2880]))

    cv2.circle(image, place(mask[:2]), int(mask[2] * scale * 16), RED, 1, cv2.LINE_AA, 4)
    cv2.circle(image, place(ball.center_px), int(ball.radius_px * scale * 16), BLUE, 1, cv2.LINE_AA, 4)
    for number, point in enumerate(points):
        if np.isfinite(point).all():
            u, v = (value // 16 for value in place(point))
            cv2.circle(image, (u, v), 3, BLUE, -1, cv2.LINE_AA)
            write(image, str(number), (u + 5, v + 4))
    write(image, "outline found", (8, PANEL + 22), BLUE)
    return write(image, "circle of the set's mask", (130, PANEL + 22), RED)


def draw_hemisphere(title: str, blue: np.ndarray, red: np.ndarray, names: tuple[str, str]) -> np.ndarray:
    """Draw directions from above: the rim is the horizon."""
    import cv2

    image, centre, radius = panel(title), (150, 165), 118
    for share in (1.0, 2 / 3, 1 / 3):
        cv2.circle(image, centre, round(radius * share), GRID, 1, cv2.LINE_AA)
    for rows, colour, size in ((red, RED, 4), (blue, BLUE, 3)):
        tilt = np.degrees(np.arccos(np.clip(rows[:, 2], -1, 1)))[:, None] / 90
        flat = rows[:, :2] / np.maximum(np.linalg.norm(rows[:, :2], axis=1, keepdims=True), 1e-9) * tilt * radius
        for x, y in flat:
            cv2.circle(image, (round(centre[0] + x), round(centre[1] - y)), size, colour, 1, cv2.LINE_AA)
    write(image, names[0], (8, PANEL + 22), BLUE)
    return write(image, names[1], (150, PANEL + 22), RED)


def draw_map(title: str, ball: Sphere, found: MatteBall, values: np.ndarray, high: float, unit: str) -> np.ndarray:
    """Draw values (P,) on the ball's face, 0 to `high` in colours."""
    import cv2

    image = panel(title)
    low = found.pixels.min(0)
    size = found.pixels.max(0) - low + 1
    flat, known = np.zeros((size[1], size[0]), np.uint8), np.zeros((size[1], size[0]), np.uint8)
    at = tuple((found.pixels - low).T[::-1])
    flat[at] = np.clip(255 * np.nan_to_num(values) / high, 0, 255)
    known[at] = np.where(np.isfinite(values), 255, 0)
    side = PANEL - 60
    colours = cv2.applyColorMap(cv2.resize(flat, (side, side)), cv2.COLORMAP_VIRIDIS)[..., ::-1]
    inside = cv2.resize(known, (side, side), interpolation=cv2.INTER_NEAREST) > 127
    image[35 : 35 + side, 30 : 30 + side][inside] = colours[inside]
    bar = cv2.applyColorMap(np.linspace(0, 255, 120, dtype=np.uint8)[None].repeat(8, 0), cv2.COLORMAP_VIRIDIS)
    image[PANEL + 14 : PANEL + 22, 60:180] = bar[..., ::-1]
    write(image, "0", (45, PANEL + 22))
    return write(image, f"{high:g} {unit}", (188, PANEL + 22))


def measure_washington() -> tuple[list[str], np.ndarray]:
    """Return lines of text and a row of pictures."""
    w = washington()
    by_chrome = explain(w.gray, w.camera, w.gray_ball, w.found.lights)
    by_given = explain(w.gray, w.camera, w.gray_ball, w.given)
    apart = {
        name: angular_error_deg(w.shaded, rows)
        for name, rows in (("chrome", w.found.lights.directions), ("given", w.given.directions))
    }
    masks = [mask_circle(REAL / "uw_psm" / "png" / name / f"{name}.mask.png") for name in ("chrome", "gray")]
    off = [
        np.abs([*(ball.center_px - mask[:2]), ball.radius_px - mask[2]]).max()
        for ball, mask in zip((w.chrome_ball, w.gray_ball), masks, strict=True)
    ]
    chrome_given = angular_error_deg(w.found.lights.directions, w.given.directions)
    lines = [
        "## University of Washington, psmImages: chrome and gray ball, 12 lights",
        "",
        "Each ball photographed apart, 512 x 340, 8 bits, nothing known of the camera. Both balls are found without a "
        f"click; centre and radius within {off[0]:.1f} px (chrome) and {off[1]:.1f} px (gray) of the circles of the "
        "set's hand-drawn masks. The set's own `lights.txt` was made by others.",
        "",
        "| the gray ball, explained by | lights from chrome, here | the set's lights.txt |",
        "|---|---|---|",
        f"| light by the gray ball's shading alone, median off | {np.median(apart['chrome']):.2f}° | "
        f"{np.median(apart['given']):.2f}° |",
        f"| residual of Lambert's law on the sphere, rms | {by_chrome.residual_percent:.1f} % | "
        f"{by_given.residual_percent:.1f} % |",
        f"| least squares normals against the sphere's, median | {by_chrome.median_deg:.2f}° | "
        f"{by_given.median_deg:.2f}° |",
        "",
        f"The two sets of lights differ by {chrome_given.mean():.2f}° (mean), {chrome_given.max():.2f}° (worst); the "
        f"sigma stated here is {np.median(w.found.lights.direction_sigma_deg):.2f}°: it covers the highlight, the "
        "outline and a camera of which nothing is known, not a ball that is no sphere. The gray ball is no perfect "
        "judge: its stain and its scratches show in the residual. Intensities read on the gray ball: "
        f"{w.found.lights.intensities.min():.3f} to {w.found.lights.intensities.max():.3f}.",
        "",
        "![psmImages](real-captures-washington.png)",
        "",
    ]
    rms = np.sqrt(np.nanmean(by_chrome.residual**2, axis=0)) * 100
    row = [
        draw_ball("chrome ball: highlights 0 .. 11", w.chrome_ball, w.found.highlights_px[0], masks[0]),
        draw_hemisphere(
            "lights (rim: horizon)", w.found.lights.directions, w.shaded, ("from chrome", "by gray shading")
        ),
        draw_map("gray ball: residual, rms of 12", w.gray_ball, by_chrome, rms, 15, "%"),
        draw_map("gray ball: normals' error", w.gray_ball, by_chrome, by_chrome.error_deg, 10, "degrees"),
    ]
    return lines, np.hstack(row)


def measure_diligent() -> tuple[list[str], np.ndarray]:
    """Return lines of text and a row of pictures."""
    d = diligent_ball()
    shaded = angular_error_deg(d.found.directions, d.given.directions)
    mirrored = angular_error_deg(d.mirrored.directions, d.given.directions)
    by_found, by_given = (explain(d.frames, d.camera, d.ball, lights) for lights in (d.found, d.given))
    off = np.abs([*(d.ball.center_px - d.outline[:2]), d.ball.radius_px - d.outline[2]]).max()
    how = (
        "It is found without a click."
        if d.by_itself
        else "Its outline is found without a click, but its gloss, four times as bright as its skin, makes it a chrome "
        "ball; as a white one it is asked for with `center_px` and `radius_px`."
    )
    columns, rows = by_given.pixels.T
    truth = angular_error_deg(d.truth[rows, columns], d.ball.normals(d.camera, by_given.pixels)[0])
    ratio = 100 * np.std(d.found.intensities / d.given.intensities)
    lines = [
        "## DiLiGenT, the ball: 96 known lights",
        "",
        f"612 x 512, 16 bits. {how} The outline lies within {off:.1f} px of the set's mask, and the set's ground truth "
        f"normals within {np.nanmedian(truth):.2f}° (median) of that sphere's. The set's lights were not used.",
        "",
        "| | median | worst |",
        "|---|---|---|",
        f"| lights by the ball's highlights (as if it were chrome) against the set's | {np.median(mirrored):.2f}° | "
        f"{mirrored.max():.2f}° |",
        f"| lights by the ball's shading (as a white ball) against the set's | {np.median(shaded):.2f}° | "
        f"{shaded.max():.2f}° |",
        f"| intensities by the ball's shading against the set's, spread | {ratio:.1f} % | |",
        f"| least squares normals, shading's lights, against the sphere | {by_found.median_deg:.2f}° | |",
        f"| least squares normals, the set's lights, against the sphere | {by_given.median_deg:.2f}° | |",
        "",
        "![DiLiGenT ball](real-captures-diligent.png)",
        "",
    ]
    rms, given = np.sqrt(np.nanmean(by_given.residual**2, axis=0)) * 100, d.given.directions
    row = [
        draw_hemisphere("lights (rim: horizon)", d.mirrored.directions, given, ("highlights", "the set's")),
        draw_hemisphere("lights (rim: horizon)", d.found.directions, given, ("shading", "the set's")),
        draw_map("residual, the set's lights", d.ball, by_given, rms, 60, "%"),
        draw_map("normals' error, the set's lights", d.ball, by_given, by_given.error_deg, 10, "degrees"),
    ]
    return lines, np.hstack(row)


def measure_columbia() -> list[str]:
    """Return lines of text."""
    c = columbia()
    matte = explain(c.frames, c.camera, c.ball, c.found)
    return [
        "## Columbia: a white sphere under three lights",
        "",
        "640 x 480, 8 bits on a pedestal, no chrome ball. Found without a click; lights from its shading, the pedestal "
        "as ambient light.",
        "",
        "| | |",
        "|---|---|",
        f"| pedestal, by the shading | {c.ambient_code:.1f} codes |",
        f"| pedestal, in the dark beside the ball | {c.dark_code:.1f} codes |",
        f"| residual of Lambert's law on the sphere, rms | {matte.residual_percent:.1f} % |",
        f"| least squares normals against the sphere's, median | {matte.median_deg:.2f}° |",
        "",
    ]


def measure_bunny() -> list[str]:
    """Return lines of text."""
    with tempfile.TemporaryDirectory() as scratch:
        b = bunny(Path(scratch))
        white = next(s for s in b.found.spheres if s.kind == "white")
        matte = explain(b.frames, b.camera, white, b.found.lights)
    return [
        "## The bunny: rendered by another program",
        "",
        "Two chrome balls of 50 px and a white one beside an object, 12 flashes at about a metre, Bayer DNG. Truth is "
        "known.",
        "",
        "| | median | worst |",
        "|---|---|---|",
        f"| direction at the object | {np.median(b.direction_error_deg):.2f}° | {b.direction_error_deg.max():.2f}° |",
        f"| position, of the distance | {np.median(b.position_error_percent):.2f} % | "
        f"{b.position_error_percent.max():.2f} % |",
        f"| intensity per channel | {np.median(np.abs(b.intensity_error_percent)):.2f} % | "
        f"{np.abs(b.intensity_error_percent).max():.2f} % |",
        f"| balls, centre or radius | | {np.abs(b.ball_error_px).max():.2f} px |",
        f"| white ball explained by the chrome's lights: residual, rms | {matte.residual_percent:.1f} % | |",
        f"| ... least squares normals against the sphere's | {matte.median_deg:.2f}° | |",
        "",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="write docs/evidence/real-captures.md and its pictures")
    arguments = parser.parse_args()
    first, first_row = measure_washington()
    second, second_row = measure_diligent()
    text = "\n".join(
        [
            "# Real captures",
            "",
            "Balls photographed by other people, calibrated without a click, and the checks that need no truth: lights "
            "that a mirror shows must explain a matte ball. Written by `benchmarks/bench_real_captures.py`; the "
            "pictures are drawn from what was measured, none shows a photograph. Pixels steeper than 73° to the "
            "viewer, clipped ones and unlit ones are left out.",
            "",
            *first,
            *second,
            *measure_columbia(),
            *measure_bunny(),
        ]
    )
    print(text)
    if arguments.write:
        (DOCS / "real-captures.md").write_text(text.rstrip() + "\n")
        write_png(DOCS / "real-captures-washington.png", first_row)
        write_png(DOCS / "real-captures-diligent.png", second_row)


if __name__ == "__main__":
    main()
