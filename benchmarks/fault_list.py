# ruff: noqa: E501 (a table, one mistake a line)
"""Plausible mistakes of a person, each made in a session, with the words that a right diagnosis must contain.

The words were written down before any message was looked at. A message names a mistake if one message matches all of
its patterns; none of them is a word that every message has ("check", "frames", "reshoot").
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.fault_pictures import (
    all_frames,
    ambient_scaled,
    by_flash,
    changed,
    cropped,
    curve,
    distorted,
    fingerprint,
    moved_midway,
    noisy,
    on_ball,
    one_frame,
    polarised,
    scratched,
    second_half,
    shifted,
    srgb,
    stain,
    stepped,
    turned_pictures,
    vignetted,
    with_room,
)
from benchmarks.fault_sessions import SESSIONS, Taken
from scene.mesh import Mesh
from scene.normals import unit

Kind = Literal["tells", "with scan", "cannot", "harmless"]
Variant = Literal["balls", "balls and light file", "light file"]
LIGHT_FILE = r"lights?\.(file|lp)|light file"
THIRD = "flash_003"


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Parameters
    ----------
    name : str
    make : callable
        Taken -> Taken with the mistake in it; None where the session cannot have it.
    words : tuple of str
        Patterns (case does not matter); one message must match all.
    kind : {"tells", "with scan", "cannot", "harmless"}
        Whether the data can tell: always, where there is a scan, never; or nothing is lost and nothing need be said.
    why : str
        Why they cannot, or why no harm is done.
    variant : str
        What the session is before: its balls tell the lights, or a right light file does, with balls in view or none
        asked for.
    """

    name: str
    make: Callable[[Taken], Taken | None]
    words: tuple[str, ...] = ()
    kind: Kind = "tells"
    why: str = ""
    variant: Variant = "balls"


def varied(taken: Taken, variant: Variant) -> Taken:
    """Return a session as its variant has it, without a mistake."""
    if variant == "balls":
        return taken
    taken = replace(taken, lights=taken.directions if taken.vectors_mm is None else taken.vectors_mm)
    return taken if variant == "balls and light file" else replace(taken, balls=[], mask=taken.object_mask)


# What is stated.


def _camera(**factors: float) -> Callable[[Taken], Taken]:
    return lambda taken: replace(
        taken,
        camera={k: v * factors.get(k, 1.0) for k, v in taken.camera.items()}
        | {k: taken.camera[k] for k in ("width", "height")},
    )


def _focal(factor: float) -> Callable[[Taken], Taken]:
    return _camera(fx=factor, fy=factor)


def _principal(share: float) -> Callable[[Taken], Taken]:
    return lambda taken: replace(
        taken, camera={**taken.camera, "cx": taken.camera["cx"] + share * taken.camera["width"]}
    )


def _diameters(factor: float, kind: str = "", *, first: bool = False) -> Callable[[Taken], Taken]:
    def change(taken: Taken) -> Taken:
        balls = [dict(ball) for ball in taken.balls]
        chosen = [ball for ball in balls if ball["kind"].startswith(kind)]
        for ball in chosen[: 1 if first else None]:
            ball["diameter_mm"] *= factor
        return replace(taken, balls=balls)

    return change


def _swapped_diameters(taken: Taken) -> Taken:
    # As different as the sizes of two balls in one drawer.
    sizes = {
        "chrome": taken.balls[taken.first("white")]["diameter_mm"],
        "white": taken.balls[taken.first("chrome")]["diameter_mm"],
    }
    return replace(taken, balls=[{**ball, "diameter_mm": sizes[ball["kind"]]} for ball in taken.balls])


def _kind_of(kind: str, other: str) -> Callable[[Taken], Taken]:
    def change(taken: Taken) -> Taken:
        balls = [dict(ball) for ball in taken.balls]
        balls[taken.first(kind)]["kind"] = other
        return replace(taken, balls=balls)

    return change


def _frames_table(**keys: object) -> Callable[[Taken], Taken]:
    return lambda taken: replace(taken, frames=keys)


# Scan and mask.


def _scan(change: Callable[[Mesh], Mesh]) -> Callable[[Taken], Taken | None]:
    return lambda taken: None if taken.scan is None else replace(taken, scan=change(taken.scan))


def _scaled(factor: float) -> Callable[[Taken], Taken | None]:
    return _scan(lambda scan: Mesh(factor * scan.vertices, scan.faces))


def _other_scan(taken: Taken) -> Taken | None:
    if taken.scan is None:
        return None
    from fixtures.mesh_shapes import SHAPES

    other = next(iter(SHAPES.values()))()
    return replace(taken, scan=Mesh(other.vertices * taken.scan.radius_mm / other.radius_mm, other.faces))


def _mask(change: Callable[[NDArray], NDArray]) -> Callable[[Taken], Taken]:
    return lambda taken: replace(taken, mask=change(taken.object_mask))


def _other_mask(mask: NDArray) -> NDArray:
    """Return a square of the object's area, where an object of another session stood."""
    other = np.zeros_like(mask)
    v, u = (int(place.mean()) for place in np.nonzero(mask))
    half = int(np.sqrt(mask.sum()) / 2)
    other[max(v - 2 * half, 0) : v, max(u - 2 * half, 0) : u] = True
    return other


# Light files.


def _lights(change: Callable[[NDArray], NDArray]) -> Callable[[Taken], Taken]:
    def made(taken: Taken) -> Taken:
        assert taken.lights is not None
        return replace(taken, lights=change(taken.lights))

    return made


def _reordered(change: Callable[[NDArray], NDArray]) -> Callable[[Taken], Taken]:
    def made(taken: Taken) -> Taken:
        assert taken.lights is not None
        order = change(np.arange(len(taken.lights)))
        return replace(taken, lights=taken.lights[order], powers=None if taken.powers is None else taken.powers[order])

    return made


def _in_degrees(taken: Taken) -> Taken:
    """Write azimuth, elevation and 1 into an .lp, as some tables have them."""
    x, y, z = taken.directions.T
    table = np.column_stack([np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(z)), np.ones(len(x))])
    return replace(taken, lights=table, middle_mm=None)


def _of_another(lights: NDArray) -> NDArray:
    ways = unit(np.random.default_rng(6).normal(size=lights.shape) * [1, 1, 0.3] + [0, 0, 1])
    return ways * np.linalg.norm(lights, axis=1, keepdims=True)


def _exchanged(taken: Taken) -> Taken:
    order = np.arange(len(taken.images))
    order[[2, 7]] = 7, 2
    return replace(taken, images=taken.images[order], directions=taken.directions[order])


def _of_light_files() -> list[Mistake]:
    changes: list[tuple[str, Callable[[NDArray], NDArray], tuple[str, ...]]] = [
        ("x mirrored", lambda to: to * [-1, 1, 1], ("x flipped|mirror|turned|x negated|-x",)),
        ("y flipped", lambda to: to * [1, -1, 1], ("y flipped|flip|y negated|-y",)),
        ("y and z swapped", lambda to: to[:, [0, 2, 1]], ("swap|axes|y and z|x, ?z, ?y|turned",)),
        ("turned by 90 degrees", lambda to: to[:, [1, 0, 2]] * [-1, 1, 1], ("turn|rotat|90|axes",)),
        ("of another session", _of_another, ("order|another|do not belong",)),
    ]  # fmt: skip
    orders: list[tuple[str, Callable[[NDArray], NDArray], tuple[str, ...]]] = [
        ("rolled by one", lambda rows: np.roll(rows, 1, 0), ("order|roll|one frame|shifted|frames later",)),
        ("reversed", lambda rows: rows[::-1], ("order|revers",)),
        (
            "shuffled",
            lambda rows: np.random.default_rng(5).permutation(rows),
            ("order|which frame|shuffl|do not belong",),
        ),
    ]
    found = []
    for variant in ("balls and light file", "light file"):
        asked = "balls in view" if variant.startswith("balls") else "no balls"
        found += [
            Mistake(f"light file {what} ({asked})", _lights(change), (LIGHT_FILE, *words), variant=variant)  # type: ignore[arg-type]
            for what, change, words in changes
        ]
        found += [
            Mistake(f"light file {what} ({asked})", _reordered(change), (LIGHT_FILE, *words), variant=variant)  # type: ignore[arg-type]
            for what, change, words in orders
        ]
        found += [
            Mistake(f"light file in degrees ({asked})", _in_degrees,
                    (LIGHT_FILE, "degrees|unit vector|axes|no directions"), variant=variant),  # type: ignore[arg-type]
            Mistake(f"two frames exchanged, light file ({asked})", _exchanged,
                    (r"flash_002|flash_007", "exchang|order|swap|" + LIGHT_FILE), variant=variant),  # type: ignore[arg-type]
        ]  # fmt: skip
    return found


SCALE = "one common factor of all lengths leaves every photograph as it is; the scan, where there is one, knows better"
LINEAR = (r"frames\.linear|linear = ",)
MOVED = ("moved|shifted|turned", "camera|table|tripod")

MISTAKES: dict[str, Mistake] = {
    mistake.name: mistake
    for mistake in (
        Mistake("nothing wrong", lambda taken: taken, kind="harmless", why="false alarms show here"),
        Mistake("nothing wrong, light file and balls", lambda taken: taken, kind="harmless",
                variant="balls and light file", why="false alarms show here"),
        Mistake("nothing wrong, light file", lambda taken: taken, kind="harmless", variant="light file",
                why="false alarms show here"),
        Mistake("two frames exchanged", _exchanged, kind="harmless", why="each frame's balls tell its own light"),
        Mistake("all diameters 10 % too large", _diameters(1.1), ("diameter_mm", "scan"), "with scan", SCALE),
        Mistake("all diameters 10 % too small", _diameters(0.9), ("diameter_mm", "scan"), "with scan", SCALE),
        Mistake("all diameters in cm", _diameters(0.1), ("diameter_mm", "scan|small"), "with scan", SCALE),
        Mistake("all diameters in inch", _diameters(1 / 25.4), ("diameter_mm", "scan|small"), "with scan", SCALE),
        Mistake("one chrome ball's diameter 10 % too small", _diameters(0.9, "chrome", first=True), ("diameter_mm",)),
        Mistake("white ball's diameter 20 % too small", _diameters(0.8, "white"), ("diameter_mm", "white")),
        Mistake("diameters of chrome and white exchanged", _swapped_diameters, ("diameter_mm",)),
        Mistake("focal length x 0.5", _focal(0.5), ("fx|focal",)),
        Mistake("focal length x 0.9", _focal(0.9), ("fx|focal",), "with scan", "depths stretch with it; what is left is within the stated sigma"),
        Mistake("focal length x 1.1", _focal(1.1), ("fx|focal",), "with scan", "depths stretch with it; what is left is within the stated sigma"),
        Mistake("focal length x 2", _focal(2.0), ("fx|focal",)),
        Mistake("principal point 5 % of the width off", _principal(0.05), ("cx",), "cannot", "all directions and normals turn alike, by some degrees"),
        Mistake("principal point 15 % of the width off", _principal(0.15), ("cx",)),
        Mistake("width and height exchanged", lambda t: replace(t, camera={**t.camera, "width": t.camera["height"], "height": t.camera["width"]}), ("width", "height")),
        Mistake("camera moved midway by 0.5 px", moved_midway(0.5), (*MOVED, "half pixel|0\\.[3-9] px"), "cannot", "half a pixel is what shading alone seems to move"),
        Mistake("camera moved midway by 2 px", moved_midway(2.0), (*MOVED, "flash_00[68]|from")),
        Mistake("camera moved midway by 10 px", moved_midway(10.0), (*MOVED, "flash_00[68]|from")),
        Mistake("camera turned midway by 2 degrees", moved_midway(0.0, 2.0), MOVED),
        Mistake("one frame 2 px off", one_frame(lambda i: shifted(i, 2.0, 0.7)), (THIRD, "moved|off|shift")),
        Mistake("one frame blurred by shake", one_frame(lambda i: cv2.blur(i, (9, 1))), (THIRD, "blur|shake|sharp")),
        Mistake("sRGB said to be linear, 16 bits", all_frames(srgb), LINEAR),
        Mistake("sRGB said to be linear, 8 bits", all_frames(srgb, bits=8), LINEAR),
        Mistake("sRGB of 8 bits, nothing said", all_frames(srgb, bits=8, frames={}), LINEAR),
        Mistake("gamma 2.2 said to be linear", all_frames(lambda i: np.clip(i, 0, 1) ** (1 / 2.2)), LINEAR),
        Mistake("a raw converter's picture style", all_frames(curve), LINEAR),
        Mistake("linear said to be sRGB", _frames_table(linear=False), LINEAR),
        Mistake("JPEG of quality 30", all_frames(srgb, bits=0, frames={"linear": False}), ("JPEG|compress|quality",)),
        Mistake("overexposed x 2", all_frames(lambda i: 2 * i), ("overexpos|clip|saturat",)),
        Mistake("overexposed x 4", all_frames(lambda i: 4 * i), ("overexpos|clip|saturat",)),
        Mistake("underexposed x 1/50", all_frames(lambda i: noisy(i / 50, 30000)), ("underexpos|too dark|expos",)),
        Mistake("black level not subtracted", lambda t: replace(all_frames(lambda i: i * 0.96 + 0.04)(t), ambient=None), ("black|pedestal|offset",)),
        Mistake("black level not subtracted, ambient frame", all_frames(lambda i: i * 0.96 + 0.04), kind="harmless", why="the ambient frame takes it off"),
        Mistake("black level too high", all_frames(lambda i: np.maximum(i - 0.04, 0)), ("black|pedestal|offset",)),
        Mistake("vignetting of 45 % at the corners", all_frames(vignetted), ("vignett|flat",), "cannot", "darker to the corners is darker albedo, too"),
        Mistake("lens distortion of 2.5 % not told", distorted, ("distort|lens",), "cannot", "it bends outlines by less than they are known"),
        Mistake("cropped, size of [camera] left", lambda t: cropped(t, told=False), ("width",)),
        Mistake("cropped, size changed, cx left", lambda t: cropped(t, told=True), ("cx",), "harmless", "cut on the right and the bottom, cx and cy stay right"),
        Mistake("pictures turned by 90 degrees, [camera] too", turned_pictures, kind="harmless", why="all agree"),
        Mistake("one frame turned by 180 degrees", one_frame(lambda i: i[::-1, ::-1]), (THIRD, "turn|rotat|orient|moved|upside")),
        Mistake("half power once", lambda t: replace(t, images=np.concatenate([t.images[:3], t.images[3:4] - 0.5 * by_flash(t)[3:4], t.images[4:]])), kind="harmless", why="the white ball tells each flash's strength"),
        Mistake("a flash did not fire", lambda t: None if t.ambient is None else replace(t, images=np.concatenate([t.images[:3], noisy(t.ambient, 30000)[None], t.images[4:]]).astype(np.float32)), (THIRD, "did not fire")),
        Mistake("exposure halved once, no EXIF", one_frame(lambda i: 0.5 * i), (THIRD, "expos|half as bright|power"), "harmless", "where the room is dark it is a flash at half power"),
        Mistake("exposure halved once, no EXIF, bright room", lambda t: None if t.ambient is None else one_frame(lambda i: 0.5 * i)(with_room(t, 0.25)), (THIRD, "expos")),
        Mistake("exposure halved once, EXIF", lambda t: replace(one_frame(lambda i: 0.5 * i)(t), exposures_s=np.where(np.arange(len(t.images)) == 3, 0.5, 1) / 100), kind="harmless", why="EXIF tells it"),
        Mistake("exposure doubled once, no EXIF", one_frame(lambda i: 2 * i), (THIRD, "expos|power|clip"), "harmless", "where the room is dark it is a flash at twice the power"),
        Mistake("one frame twice", lambda t: replace(t, images=np.concatenate([t.images[:-1], t.images[2:3]]), directions=np.concatenate([t.directions[:-1], t.directions[2:3]])), ("flash_002", "same (photograph|light|place)")),
        Mistake("white balance changed midway", lambda t: changed(t, lambda i: i * np.array([1.3, 1, 0.8], np.float32), second_half(t)), kind="harmless", why="the white ball tells each channel's strength"),
        Mistake("every frame brightened by itself", lambda t: replace(t, images=t.images / np.quantile(t.images, 0.99, (1, 2, 3), keepdims=True) * 0.7, ambient=None), ("bright|expos|ambient",), "harmless", "the white ball tells each frame's strength"),
        Mistake("crossed polarisers", polarised, ("highlight|shows the flash|mirror", "chrome")),
        Mistake("white ball with a stain", lambda t: on_ball(t, "white", stain), ("white ball", "stain|dirt|matte|even|shadow|n\\.l|misses")),
        Mistake("chrome ball scratched", lambda t: on_ball(t, "chrome", scratched), ("chrome|ball", "scratch|dust|highlight"), "harmless", "the highlight is larger than the scratches"),
        Mistake("fingerprint on a chrome ball", fingerprint, ("chrome|ball", "blur|dirt|clean|highlight|grease")),
        Mistake("white ball called chrome", _kind_of("white", "chrome"), ("chrome", "white", "kind|ball")),
        Mistake("chrome ball called white", _kind_of("chrome", "white"), ("chrome", "white", "kind|ball")),
        Mistake("one ball too many stated", lambda t: replace(t, balls=[*t.balls, dict(t.balls[0])]), ("ball|spheres",)),
        Mistake("a chrome ball moved midway by 6 px", lambda t: stepped(t, t.region(t.first("chrome")), 6.0), ("ball", "moved|rolled|flash_00[68]")),
        Mistake("the object moved midway by 5 px", lambda t: stepped(t, t.object_mask, 5.0), ("object|moved", "flash_00[68]|from")),
        Mistake("room light on, no ambient frame", lambda t: replace(with_room(t, 0.25), ambient=None), ("ambient|room",)),
        Mistake("ambient frame at half the exposure", ambient_scaled(0.5), ("ambient", "expos|bright|dark|room")),
        Mistake("ambient frame at twice the exposure", ambient_scaled(2.0), ("ambient", "expos|bright|flash")),
        Mistake("a flash frame for the ambient frame", lambda t: replace(t, ambient=t.images[5]), ("ambient", "flash")),
        Mistake("scan of another object", _other_scan, ("scan", "fit|another|object")),
        Mistake("scan mirrored", _scan(lambda m: Mesh(m.vertices * [-1.0, 1, 1], m.faces[:, [0, 2, 1]])), ("scan", "mirror")),
        Mistake("scan in inch", _scaled(1 / 25.4), ("scan", "unit|times too")),
        Mistake("scan in m", _scaled(0.001), ("scan", "unit|times too")),
        Mistake("scan 10 % too large", _scaled(1.1), ("scan", "large|scale|size|unit", "diameter_mm|scan_unit|focal|fx")),
        Mistake("scan 10 % too small", _scaled(0.9), ("scan", "small|scale|size|unit", "diameter_mm|scan_unit|focal|fx")),
        Mistake("mask 12 px off", _mask(lambda m: np.roll(m, (4, 12), (0, 1))), ("mask",)),
        Mistake("mask inverted", _mask(lambda m: ~m), ("mask",)),
        Mistake("mask of another object", _mask(_other_mask), ("mask",)),
        *_of_light_files(),
    )
}  # fmt: skip


@cache
def session(name: str) -> Taken:
    """Return a session, made once a process."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        return SESSIONS[name](Path(folder))
