"""Plausible mistakes of a person, each made in a session, with the words that a right diagnosis must contain.

The words were written down before any message was looked at. A message names a mistake if it matches all patterns; none
of them is a word that every message has ("check", "frames", "reshoot").
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.fault_pictures import (
    Make,
    all_frames,
    ambient_scaled,
    bounced,
    by_flash,
    changed,
    creeping,
    cropped,
    curve,
    distorted,
    everywhere,
    fingerprint,
    grown,
    half_shadowed,
    lamp_midway,
    lit_room,
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
    window,
)
from benchmarks.fault_sessions import LackingError, Taken
from scene.mesh import Mesh
from scene.normals import unit

Variant = Literal["balls", "balls and light file", "light file"]


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Parameters
    ----------
    name : str
    make : callable
        Taken -> Taken with the mistake in it; raises LackingError where the session cannot have it.
    words : str
        Patterns with ` & ` between them (case does not matter); one message must match all. Empty: nothing names it.
    tells : str
        Whether the data can tell: "yes"; "with a scan: why"; "no: why"; "no harm: why", where nothing need be said.
    variant : str
        What the session is before: its balls tell the lights, or a right light file does, with balls in view or none
        asked for.
    """

    name: str
    make: Make
    words: str = ""
    tells: str = "yes"
    variant: Variant = "balls"

    def can_tell(self, taken: Taken) -> bool:
        """Whether a session's data can tell it."""
        return self.tells == "yes" or (self.tells.startswith("with a scan") and taken.scan is not None)


def varied(taken: Taken, variant: Variant) -> Taken:
    """Return a session as its variant has it, without a mistake."""
    if variant == "balls":
        return taken
    taken = replace(taken, lights=taken.vectors)
    return taken if variant == "balls and light file" else replace(taken, balls=[], mask=taken.object_mask)


def _camera(**changes: Callable[[dict[str, Any]], float]) -> Make:
    """Return what states other values in [camera], made from those that are right."""
    return lambda taken: replace(taken, camera=taken.camera | {key: f(taken.camera) for key, f in changes.items()})


def _focal(factor: float) -> Make:
    return _camera(fx=lambda camera: factor * camera["fx"], fy=lambda camera: factor * camera["fy"])


def _principal(share: float) -> Make:
    return _camera(cx=lambda camera: camera["cx"] + share * camera["width"])


def _diameters(factor: float, kind: str = "", *, first: bool = False) -> Make:
    def make(taken: Taken) -> Taken:
        chosen = [i for i, ball in enumerate(taken.balls) if ball["kind"].startswith(kind)][: 1 if first else None]
        if not chosen:
            raise LackingError
        sizes = [ball["diameter_mm"] * (factor if i in chosen else 1) for i, ball in enumerate(taken.balls)]
        return replace(taken, balls=[b | {"diameter_mm": mm} for b, mm in zip(taken.balls, sizes, strict=True)])

    return make


def _swapped_diameters(taken: Taken) -> Taken:
    chrome, white = (taken.balls[taken.first(kind)]["diameter_mm"] for kind in ("chrome", "white"))
    sizes = {"chrome": white, "white": chrome}
    return replace(taken, balls=[ball | {"diameter_mm": sizes[ball["kind"]]} for ball in taken.balls])


def _called(kind: str, other: str) -> Make:
    def make(taken: Taken) -> Taken:
        balls = list(taken.balls)
        balls[taken.first(kind)] = balls[taken.first(kind)] | {"kind": other}
        return replace(taken, balls=balls)

    return make


def _scan(change: Callable[[Mesh], Mesh]) -> Make:
    def make(taken: Taken) -> Taken:
        if taken.scan is None:
            raise LackingError
        return replace(taken, scan=change(taken.scan))

    return make


def _scaled(factor: float) -> Make:
    return _scan(lambda scan: Mesh(factor * scan.vertices, scan.faces))


def _other_scan(scan: Mesh) -> Mesh:
    from fixtures.mesh_shapes import SHAPES

    other = next(iter(SHAPES.values()))()
    return Mesh(other.vertices * scan.radius_mm / other.radius_mm, other.faces)


def _mask(change: Callable[[NDArray], NDArray]) -> Make:
    return lambda taken: replace(taken, mask=change(taken.object_mask))


def _other_mask(mask: NDArray) -> NDArray:
    """Return a square of the object's area, where an object of another session stood."""
    other = np.zeros_like(mask)
    v, u = (int(place.mean()) for place in np.nonzero(mask))
    half = int(np.sqrt(mask.sum()) / 2)
    other[max(v - 2 * half, 0) : v, max(u - 2 * half, 0) : u] = True
    return other


def _ordered(taken: Taken, order: NDArray, fields: tuple[str, ...] = ("images", "vectors")) -> Taken:
    """Return the session with some of what is listed by frames in another order, or repeated."""
    return replace(taken, **{name: getattr(taken, name)[order] for name in fields})


def _exchanged(taken: Taken) -> Taken:
    order = np.arange(len(taken.images))
    order[[2, 7]] = 7, 2
    return _ordered(taken, order)


def _twice(taken: Taken) -> Taken:
    return _ordered(taken, np.append(np.arange(len(taken.images) - 1), 2))


def _in_degrees(taken: Taken) -> Taken:
    """Write azimuth, elevation and 1 into an .lp, as some tables have them."""
    x, y, z = unit(taken.vectors).T
    table = np.column_stack([np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(z)), np.ones(len(x))])
    return replace(taken, lights=table, is_lp=True)


def _of_another(lights: NDArray) -> NDArray:
    ways = unit(np.random.default_rng(6).normal(size=lights.shape) * [1, 1, 0.3] + [0, 0, 1])
    return ways * np.linalg.norm(lights, axis=1, keepdims=True)


def _of_light_files(variant: Variant) -> list[Mistake]:
    """Return the mistakes of a light file; their names end with whether balls are in view."""

    def lights(change: Callable[[NDArray], NDArray]) -> Make:
        return lambda taken: replace(taken, lights=change(taken.vectors))

    def order(change: Callable[[NDArray], NDArray]) -> Make:
        # The strengths stand in the same rows.
        return lambda taken: _ordered(taken, change(np.arange(len(taken.vectors))), ("lights", "powers"))

    mixed = np.random.default_rng(5).permutation
    changes: list[tuple[str, Make, str]] = [
        ("x mirrored", lights(lambda to: to * [-1, 1, 1]), "x flipped|mirror|turned|x negated|-x"),
        ("y flipped", lights(lambda to: to * [1, -1, 1]), "y flipped|flip|y negated|-y"),
        ("y and z swapped", lights(lambda to: to[:, [0, 2, 1]]), "swap|axes|y and z|x, ?z, ?y|turned"),
        ("turned by 90 degrees", lights(lambda to: to[:, [1, 0, 2]] * [-1, 1, 1]), "turn|rotat|90|axes"),
        ("of another session", lights(_of_another), "order|another|do not belong"),
        ("rolled by one", order(lambda rows: np.roll(rows, 1)), "order|roll|one frame|shifted|frames later"),
        ("shuffled", order(mixed), "order|which frame|shuffl|do not belong"),
        ("in degrees", _in_degrees, "degrees|unit vector|axes|no directions"),
    ]
    asked = "balls in view" if variant.startswith("balls") else "no balls"
    return [
        Mistake(f"nothing wrong, {variant}", lambda taken: taken, "", SOUND, variant),
        *(
            Mistake(f"light file {what} ({asked})", make, f"{LIGHT_FILE} & {words}", variant=variant)
            for what, make, words in changes
        ),
        Mistake(
            f"two frames exchanged, light file ({asked})", _exchanged,
            f"flash_002|flash_007 & exchang|order|swap|{LIGHT_FILE}", variant=variant,
        ),
    ]  # fmt: skip


SOUND = "no harm: false alarms show here"
LIGHT_FILE = r"lights?\.(file|lp)|light file"
SCALE = "with a scan: one common factor of all lengths leaves every photograph as it is; the scan knows better"
DEPTHS = "with a scan: depths stretch with it; what is left is within the stated sigma"
WHITE = "no harm: the white ball tells each flash's and each channel's strength"
DARK_ROOM = "no harm: where the room is dark it is a flash of another power"
LINEAR = r"frames\.linear|linear = "
MOVED = "moved|shifted|turned & camera|table|tripod"
FROM = "flash_00[678]|from"
"""Of the middle of the session."""
SCALED = "scale|size|unit & diameter_mm|scan_unit|focal|fx"
BLACK, CLIPPED = "black|pedestal|offset", "overexpos|clip|saturat"
KINDS = "chrome & white & kind|ball"
THIRD = "flash_003"

ALL = (
    Mistake("nothing wrong", lambda taken: taken, "", SOUND),
    Mistake("two frames exchanged", _exchanged, "", "no harm: each frame's balls tell its own light"),
    Mistake("all diameters 10 % too large", _diameters(1.1), "diameter_mm & scan", SCALE),
    Mistake("all diameters 10 % too small", _diameters(0.9), "diameter_mm & scan", SCALE),
    Mistake("all diameters in inch", _diameters(1 / 25.4), "diameter_mm & scan|small", SCALE),
    Mistake("one chrome ball's diameter 10 % too small", _diameters(0.9, "chrome", first=True), "diameter_mm"),
    Mistake("white ball's diameter 20 % too small", _diameters(0.8, "white"), "diameter_mm & white"),
    Mistake("diameters of chrome and white exchanged", _swapped_diameters, "diameter_mm"),
    Mistake("focal length x 0.5", _focal(0.5), "fx|focal"),
    Mistake("focal length x 0.9", _focal(0.9), "fx|focal", DEPTHS),
    Mistake("focal length x 1.1", _focal(1.1), "fx|focal", DEPTHS),
    Mistake("focal length x 2", _focal(2.0), "fx|focal"),
    Mistake("principal point 5 % of the width off", _principal(0.05), "cx",
            "no: all directions and normals turn alike, by some degrees"),
    Mistake("principal point 15 % of the width off", _principal(0.15), "cx"),
    Mistake("width and height exchanged", _camera(width=lambda c: c["height"], height=lambda c: c["width"]),
            "width & height"),
    Mistake("camera moved midway by 0.5 px", moved_midway(0.5), f"{MOVED} & half pixel|0\\.[3-9] px",
            "no: half a pixel is what shading alone seems to move"),
    Mistake("camera moved midway by 2 px", moved_midway(2.0), f"{MOVED} & {FROM}"),
    Mistake("camera moved midway by 10 px", moved_midway(10.0), f"{MOVED} & {FROM}"),
    Mistake("camera turned midway by 2 degrees", moved_midway(0.0, 2.0), MOVED),
    Mistake("one frame 2 px off", one_frame(lambda i: shifted(i, 2.0, 0.7)), f"{THIRD} & moved|off|shift"),
    Mistake("one frame blurred by shake", one_frame(lambda i: cv2.blur(i, (9, 1))), f"{THIRD} & blur|shake|sharp"),
    Mistake("sRGB said to be linear", all_frames(srgb), LINEAR),
    Mistake("sRGB of 8 bits, nothing said", all_frames(srgb, bits=8, frames={}), LINEAR),
    Mistake("gamma 2.2 said to be linear", all_frames(lambda i: np.clip(i, 0, 1) ** (1 / 2.2)), LINEAR),
    Mistake("a raw converter's picture style", all_frames(curve), LINEAR),
    Mistake("linear said to be sRGB", lambda taken: replace(taken, frames={"linear": False}), LINEAR),
    Mistake("JPEG of quality 30", all_frames(srgb, bits=0, frames={"linear": False}), "JPEG|compress|quality"),
    Mistake("overexposed x 2", all_frames(lambda i: 2 * i), CLIPPED),
    Mistake("overexposed x 4", all_frames(lambda i: 4 * i), CLIPPED),
    Mistake("underexposed x 1/50", all_frames(lambda i: noisy(i / 50)), "underexpos|too dark|expos"),
    Mistake("black level not subtracted", lambda t: replace(everywhere(t, lambda i: i * 0.96 + 0.04), ambient=None),
            BLACK),
    Mistake("black level not subtracted, ambient frame", all_frames(lambda i: i * 0.96 + 0.04), "",
            "no harm: the ambient frame takes it off"),
    Mistake("black level too high", all_frames(lambda i: np.maximum(i - 0.04, 0)), BLACK),
    Mistake("vignetting of 45 % at the corners", all_frames(vignetted), "vignett|flat",
            "no: darker to the corners is darker albedo, too"),
    Mistake("lens distortion of 2.5 % not told", distorted, "distort|lens",
            "no: it bends outlines by less than they are known"),
    Mistake("cropped, size of [camera] left", cropped, "width"),
    Mistake("cropped, size changed, cx left", lambda t: _camera(width=lambda _: cropped(t).images.shape[2])(cropped(t)),
            "cx", "no harm: cut on the right, cx and cy stay right"),
    Mistake("pictures turned by 90 degrees, [camera] too", turned_pictures, "", "no harm: all agree"),
    Mistake("one frame turned by 180 degrees", one_frame(lambda i: i[::-1, ::-1]),
            f"{THIRD} & turn|rotat|orient|moved|upside"),
    Mistake("half power once", lambda t: changed(t, lambda i: i - 0.5 * by_flash(t)[3], [3]), "", WHITE),
    Mistake("a flash did not fire", lambda t: changed(t, lambda _: noisy(t.dark), [3]), f"{THIRD} & did not fire"),
    Mistake("exposure halved once, no EXIF", one_frame(lambda i: 0.5 * i), f"{THIRD} & expos|half as bright|power",
            DARK_ROOM),
    Mistake("exposure halved once, no EXIF, bright room", lambda t: one_frame(lambda i: 0.5 * i)(lit_room(t)),
            f"{THIRD} & expos"),
    Mistake("exposure halved once, EXIF",
            lambda t: replace(one_frame(lambda i: 0.5 * i)(t),
                              exposures_s=np.where(np.arange(len(t.images)) == 3, 0.005, 0.01)),
            "", "no harm: EXIF tells it"),
    Mistake("exposure doubled once, no EXIF", one_frame(lambda i: 2 * i), f"{THIRD} & expos|power|clip", DARK_ROOM),
    Mistake("one frame twice", _twice, "flash_002 & same (photograph|light|place)"),
    Mistake("white balance changed midway",
            lambda t: changed(t, lambda i: i * np.array([1.3, 1, 0.8], np.float32), second_half(t)), "", WHITE),
    Mistake("every frame brightened by itself",
            lambda t: replace(changed(t, lambda i: 0.7 * i / np.quantile(i, 0.99), slice(None)), ambient=None),
            "bright|expos|ambient", WHITE),
    Mistake("crossed polarisers", polarised, "highlight|shows the flash|mirror & chrome"),
    Mistake("white ball with a stain", on_ball("white", stain),
            "white ball & stain|dirt|matte|even|shadow|n\\.l|misses"),
    Mistake("chrome ball scratched", on_ball("chrome", scratched), "chrome|ball & scratch|dust|highlight",
            "no harm: the highlight is larger than the scratches"),
    Mistake("fingerprint on a chrome ball", fingerprint, "chrome|ball & blur|dirt|clean|highlight|grease"),
    Mistake("white ball called chrome", _called("white", "chrome"), KINDS),
    Mistake("chrome ball called white", _called("chrome", "white"), KINDS),
    Mistake("one ball too many stated", lambda t: replace(t, balls=[*t.balls, t.balls[0]]), "ball|spheres"),
    Mistake("a chrome ball moved midway by 6 px", lambda t: stepped(t, t.region(t.first("chrome")), 6.0),
            f"ball & moved|rolled|{FROM}"),
    Mistake("the object moved midway by 5 px", lambda t: stepped(t, t.object_mask, 5.0), f"object|moved & {FROM}"),
    Mistake("room light on, no ambient frame", lambda t: replace(lit_room(t), ambient=None), "ambient|room"),
    Mistake("ambient frame at half the exposure", ambient_scaled(0.5), "ambient & expos|bright|dark|room"),
    Mistake("ambient frame at twice the exposure", ambient_scaled(2.0), "ambient & expos|bright|flash"),
    Mistake("a flash frame for the ambient frame", lambda t: replace(t, ambient=t.images[5]), "ambient & flash"),
    Mistake("scan of another object", _scan(_other_scan), "scan & fit|another|object"),
    Mistake("scan mirrored", _scan(lambda m: Mesh(m.vertices * [-1.0, 1, 1], m.faces[:, [0, 2, 1]])), "scan & mirror"),
    Mistake("scan in inch", _scaled(1 / 25.4), "scan & unit|times too"),
    Mistake("scan 10 % too large", _scaled(1.1), f"scan & large|{SCALED}"),
    Mistake("scan 10 % too small", _scaled(0.9), f"scan & small|{SCALED}"),
    Mistake("a lamp switched on midway", lamp_midway, f"lamp|light & {FROM}"),
    Mistake("half of the object in shadow in three frames", half_shadowed, "flash_001 & flash_003 & shadow|dark"),
    Mistake("focus breathes by 1 %", grown(lambda count: np.linspace(1, 1.01, count)), "focus|zoom|grow|magnif|size",),
    Mistake("focal length grows by 2 % midway",
            grown(lambda count: np.where(np.arange(count) < count // 2, 1, 1.02)), f"focus|zoom|grow|focal & {FROM}"),
    Mistake("a chrome ball creeps by 0.35 px a frame", creeping, "ball & moved|creep|drift|roll"),
    Mistake("a window in all chrome balls, no ambient frame", window, "window|lamp|ambient|room"),
    Mistake("clipped at 0.4 of the stated white", all_frames(lambda i: np.minimum(i, 0.4)), CLIPPED),
    Mistake("one frame of another session", one_frame(lambda i: i[:, ::-1]), f"{THIRD} & another|moved|off|belong"),
    Mistake("a second flash fires once", lambda t: changed(t, lambda i: i + by_flash(t)[7], [3]),
            f"{THIRD} & second|two|another|lamp & flash|light"),
    Mistake("a wall gives back a fifth of each flash", bounced, "wall|bounce|reflect|second light"),
    Mistake("mask 12 px off", _mask(lambda m: np.roll(m, (4, 12), (0, 1))), "mask"),
    Mistake("mask inverted", _mask(lambda m: ~m), "mask"),
    Mistake("mask of another object", _mask(_other_mask), "mask"),
    *_of_light_files("balls and light file"),
    *_of_light_files("light file"),
)  # fmt: skip
MISTAKES = {mistake.name: mistake for mistake in ALL}
