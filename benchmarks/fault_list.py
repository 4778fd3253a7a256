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

from benchmarks.fault_sessions import SESSIONS, Taken
from scene.mesh import Mesh
from scene.normals import unit

Kind = Literal["tells", "with scan", "cannot", "harmless"]
Variant = Literal["balls", "balls and light file", "light file", "no balls' ambient"]
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


# Pictures.


def _flash(taken: Taken) -> NDArray:
    return taken.images - (0 if taken.ambient is None else taken.ambient)


def _shifted(image: NDArray, right: float, down: float = 0.0, turn_deg: float = 0.0) -> NDArray:
    height, width = image.shape[:2]
    matrix = cv2.getRotationMatrix2D((width / 2, height / 2), turn_deg, 1.0)
    matrix[:, 2] += right, down
    return cv2.warpAffine(image, matrix, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def _each(taken: Taken, change: Callable[[NDArray], NDArray], which: slice | list[int] = slice(None)) -> Taken:
    """Return the session with some flash frames changed; all: the ambient frame, too."""
    images = taken.images.copy()
    images[which] = np.stack([change(image) for image in images[which]])
    everything = which == slice(None) and taken.ambient is not None
    return replace(taken, images=images, ambient=change(taken.ambient) if everything else taken.ambient)  # type: ignore[arg-type]


def _second_half(taken: Taken) -> slice:
    return slice(len(taken.images) // 2, None)


def _moved(right: float, turn_deg: float = 0.0) -> Callable[[Taken], Taken]:
    return lambda taken: _each(taken, lambda image: _shifted(image, right, right / 3, turn_deg), _second_half(taken))


def _one(change: Callable[[NDArray], NDArray]) -> Callable[[Taken], Taken]:
    return lambda taken: _each(taken, change, [3])


def _all(change: Callable[[NDArray], NDArray], **more: object) -> Callable[[Taken], Taken]:
    return lambda taken: replace(_each(taken, change), **more)  # type: ignore[arg-type]


def _srgb(image: NDArray) -> NDArray:
    linear = np.clip(image, 0, 1)
    return np.where(linear < 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


def _curve(image: NDArray) -> NDArray:
    """A raw converter's picture style: sRGB with an S on top."""
    coded = _srgb(image)
    return coded + 0.12 * np.sin(2 * np.pi * (coded - 0.5)) / 2


def _noisy(image: NDArray, white_e: float) -> NDArray:
    rng = np.random.default_rng(len(image))
    return image + rng.normal(size=image.shape) * np.sqrt(np.maximum(image, 0) / white_e + (5 / white_e) ** 2)


def _vignetted(image: NDArray) -> NDArray:
    height, width = image.shape[:2]
    v, u = np.mgrid[:height, :width]
    square = ((u - width / 2) ** 2 + (v - height / 2) ** 2) / ((width / 2) ** 2 + (height / 2) ** 2)
    return (image * (1 - 0.45 * square)[..., None]).astype(np.float32)


def _distorted(taken: Taken) -> Taken:
    """Barrel distortion of 2.5 % at the corners."""
    camera = taken.camera
    height, width = taken.images.shape[1:3]
    corner = np.hypot(width, height) / 2 / camera["fx"]
    matrix = np.array([[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]])
    v, u = np.mgrid[:height, :width]
    lens = np.array([-0.025 / corner**2, 0, 0, 0, 0])
    ideal = cv2.undistortPoints(
        np.stack([u, v], -1).reshape(-1, 1, 2).astype(np.float64), matrix, lens, P=matrix
    ).reshape(height, width, 2)
    return _each(
        taken,
        lambda image: cv2.remap(
            image, ideal[..., 0].astype(np.float32), ideal[..., 1].astype(np.float32), cv2.INTER_CUBIC
        ),
    )


def _step(taken: Taken, where: NDArray[np.bool_], right: float) -> Taken:
    """Move what is under a mask, and what is just around it, in the second half of the frames."""
    soft = cv2.GaussianBlur(cv2.dilate(where.astype(np.float32), np.ones((9, 9))), (0, 0), 1.5)[..., None]

    def change(image: NDArray) -> NDArray:
        cover = np.clip(_shifted(soft[..., 0], right, right / 3), 0, 1)[..., None]
        return (1 - cover) * image + cover * _shifted(image, right, right / 3)

    return _each(taken, change, _second_half(taken))


def _on_ball(taken: Taken, kind: str, change: Callable[[NDArray, NDArray, NDArray], NDArray]) -> Taken:
    """Change the pixels of the first ball of a kind; `change` takes values, and x, y in radii from its middle."""
    number = taken.first(kind)
    region, place = taken.region(number), taken.places[number]
    v, u = np.nonzero(region)
    x, y = (u - place.center_px[0]) / place.radius_px, (v - place.center_px[1]) / place.radius_px

    def painted(image: NDArray) -> NDArray:
        image = image.copy()
        image[v, u] = change(image[v, u], x, y)
        return image

    return _each(taken, painted)


def _stain(values: NDArray, x: NDArray, y: NDArray) -> NDArray:
    return np.where((np.hypot(x - 0.25, y + 0.1) < 0.35)[:, None], 0.55 * values, values)


def _scratched(values: NDArray, x: NDArray, y: NDArray) -> NDArray:
    rng = np.random.default_rng(3)
    dull = np.zeros(len(x), bool)
    for angle, off in zip(rng.uniform(0, np.pi, 25), rng.uniform(-0.9, 0.9, 25), strict=True):
        dull |= np.abs(x * np.cos(angle) + y * np.sin(angle) - off) < 0.012
    return np.where(dull[:, None], 0.5 * values + 0.1 * np.median(values), values)


def _fingerprint(taken: Taken) -> Taken:
    """Grease over half a chrome ball: what it mirrors is blurred there."""
    place = taken.places[taken.first("chrome")]
    _v, u = np.indices(taken.object_mask.shape)
    greasy = taken.region(taken.first("chrome")) & (u < place.center_px[0])
    return _each(
        taken,
        lambda image: np.where(greasy[..., None], cv2.GaussianBlur(image, (0, 0), 0.12 * place.radius_px), image),
    )


def _polarised(taken: Taken) -> Taken:
    """Crossed polarisers: no mirror shows the flash."""
    out = taken
    for number, ball in enumerate(taken.balls):
        if ball["kind"] == "chrome":
            region = taken.region(number, grow_px=2)
            out = _each(
                out,
                lambda image, region=region: np.where(
                    region[..., None], np.minimum(image, 1.3 * np.median(image[region], axis=0) + 0.01), image
                ),
            )
    return out


def _with_room(taken: Taken, share: float) -> Taken:
    """Return the session with more of the room's light: the mean flash frame, evenly, so much of it."""
    room = taken.ambient if taken.ambient is not None else 0
    more = share * cv2.GaussianBlur(_flash(taken).mean(0), (0, 0), 2)
    return replace(taken, images=taken.images + more, ambient=(room + more).astype(np.float32))


def _ambient_scaled(factor: float) -> Callable[[Taken], Taken]:
    def change(taken: Taken) -> Taken:
        lit = _with_room(taken, 0.25)
        return replace(lit, ambient=lit.ambient * np.float32(factor))  # type: ignore[operator]

    return change


def _cropped(taken: Taken, *, told: bool) -> Taken:
    height, width = taken.images.shape[1:3]
    x, y = width // 8 // 2 * 2, 0
    rows, columns = slice(y, height), slice(0, width - x)
    camera = dict(taken.camera)
    if told:
        camera["width"] = width - x
    cut = taken.ambient
    return replace(
        taken,
        images=taken.images[:, rows, columns],
        ambient=None if cut is None else cut[rows, columns],
        camera=camera,
        mask=None,
        normals=None,
    )


def _turned_pictures(taken: Taken) -> Taken:
    camera = dict(taken.camera)
    camera["width"], camera["height"] = camera["height"], camera["width"]
    camera["cx"], camera["cy"] = camera["cy"], camera["height"] - 1 - camera["cx"]
    turned = taken.directions @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    ambient = None if taken.ambient is None else np.rot90(taken.ambient)
    images = np.rot90(taken.images, axes=(1, 2))
    mask = np.ascontiguousarray(np.rot90(taken.object_mask))
    return replace(
        taken, images=images, ambient=ambient, camera=camera, directions=turned, mask=mask, object_mask=mask,
        normals=None, scan=None, pose=None,
    )  # fmt: skip


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
        Mistake("camera moved midway by 0.5 px", _moved(0.5), (*MOVED, "half pixel|0\\.[3-9] px"), "cannot", "half a pixel is what shading alone seems to move"),
        Mistake("camera moved midway by 2 px", _moved(2.0), (*MOVED, "flash_00[68]|from")),
        Mistake("camera moved midway by 10 px", _moved(10.0), (*MOVED, "flash_00[68]|from")),
        Mistake("camera turned midway by 2 degrees", _moved(0.0, 2.0), MOVED),
        Mistake("one frame 2 px off", _one(lambda i: _shifted(i, 2.0, 0.7)), (THIRD, "moved|off|shift")),
        Mistake("one frame blurred by shake", _one(lambda i: cv2.blur(i, (9, 1))), (THIRD, "blur|shake|sharp")),
        Mistake("sRGB said to be linear, 16 bits", _all(_srgb), LINEAR),
        Mistake("sRGB said to be linear, 8 bits", _all(_srgb, bits=8), LINEAR),
        Mistake("sRGB of 8 bits, nothing said", _all(_srgb, bits=8, frames={}), LINEAR),
        Mistake("gamma 2.2 said to be linear", _all(lambda i: np.clip(i, 0, 1) ** (1 / 2.2)), LINEAR),
        Mistake("a raw converter's picture style", _all(_curve), LINEAR),
        Mistake("linear said to be sRGB", _frames_table(linear=False), LINEAR),
        Mistake("JPEG of quality 30", _all(_srgb, bits=0, frames={"linear": False}), ("JPEG|compress|quality",)),
        Mistake("overexposed x 2", _all(lambda i: 2 * i), ("overexpos|clip|saturat",)),
        Mistake("overexposed x 4", _all(lambda i: 4 * i), ("overexpos|clip|saturat",)),
        Mistake("underexposed x 1/50", _all(lambda i: _noisy(i / 50, 30000)), ("underexpos|too dark|expos",)),
        Mistake("black level not subtracted", lambda t: replace(_all(lambda i: i * 0.96 + 0.04)(t), ambient=None), ("black|pedestal|offset",)),
        Mistake("black level not subtracted, ambient frame", _all(lambda i: i * 0.96 + 0.04), kind="harmless", why="the ambient frame takes it off"),
        Mistake("black level too high", _all(lambda i: np.maximum(i - 0.04, 0)), ("black|pedestal|offset",)),
        Mistake("vignetting of 45 % at the corners", _all(_vignetted), ("vignett|flat",), "cannot", "darker to the corners is darker albedo, too"),
        Mistake("lens distortion of 2.5 % not told", _distorted, ("distort|lens",), "cannot", "it bends outlines by less than they are known"),
        Mistake("cropped, size of [camera] left", lambda t: _cropped(t, told=False), ("width",)),
        Mistake("cropped, size changed, cx left", lambda t: _cropped(t, told=True), ("cx",), "harmless", "cut on the right and the bottom, cx and cy stay right"),
        Mistake("pictures turned by 90 degrees, [camera] too", _turned_pictures, kind="harmless", why="all agree"),
        Mistake("one frame turned by 180 degrees", _one(lambda i: i[::-1, ::-1]), (THIRD, "turn|rotat|orient|moved|upside")),
        Mistake("half power once", lambda t: replace(t, images=np.concatenate([t.images[:3], t.images[3:4] - 0.5 * _flash(t)[3:4], t.images[4:]])), kind="harmless", why="the white ball tells each flash's strength"),
        Mistake("a flash did not fire", lambda t: None if t.ambient is None else replace(t, images=np.concatenate([t.images[:3], _noisy(t.ambient, 30000)[None], t.images[4:]]).astype(np.float32)), (THIRD, "did not fire")),
        Mistake("exposure halved once, no EXIF", _one(lambda i: 0.5 * i), (THIRD, "expos|half as bright|power"), "harmless", "where the room is dark it is a flash at half power"),
        Mistake("exposure halved once, no EXIF, bright room", lambda t: None if t.ambient is None else _one(lambda i: 0.5 * i)(_with_room(t, 0.25)), (THIRD, "expos")),
        Mistake("exposure halved once, EXIF", lambda t: replace(_one(lambda i: 0.5 * i)(t), exposures_s=np.where(np.arange(len(t.images)) == 3, 0.5, 1) / 100), kind="harmless", why="EXIF tells it"),
        Mistake("exposure doubled once, no EXIF", _one(lambda i: 2 * i), (THIRD, "expos|power|clip"), "harmless", "where the room is dark it is a flash at twice the power"),
        Mistake("one frame twice", lambda t: replace(t, images=np.concatenate([t.images[:-1], t.images[2:3]]), directions=np.concatenate([t.directions[:-1], t.directions[2:3]])), ("flash_002", "same (photograph|light|place)")),
        Mistake("white balance changed midway", lambda t: _each(t, lambda i: i * np.float32([1.3, 1, 0.8]), _second_half(t)), kind="harmless", why="the white ball tells each channel's strength"),
        Mistake("every frame brightened by itself", lambda t: replace(t, images=t.images / np.quantile(t.images, 0.99, (1, 2, 3), keepdims=True) * 0.7, ambient=None), ("bright|expos|ambient",), "harmless", "the white ball tells each frame's strength"),
        Mistake("crossed polarisers", _polarised, ("highlight|shows the flash|mirror", "chrome")),
        Mistake("white ball with a stain", lambda t: _on_ball(t, "white", _stain), ("white ball", "stain|dirt|matte|even|shadow|n\\.l|misses")),
        Mistake("chrome ball scratched", lambda t: _on_ball(t, "chrome", _scratched), ("chrome|ball", "scratch|dust|highlight"), "harmless", "the highlight is larger than the scratches"),
        Mistake("fingerprint on a chrome ball", _fingerprint, ("chrome|ball", "blur|dirt|clean|highlight|grease")),
        Mistake("white ball called chrome", _kind_of("white", "chrome"), ("chrome", "white", "kind|ball")),
        Mistake("chrome ball called white", _kind_of("chrome", "white"), ("chrome", "white", "kind|ball")),
        Mistake("one ball too many stated", lambda t: replace(t, balls=[*t.balls, dict(t.balls[0])]), ("ball|spheres",)),
        Mistake("a chrome ball moved midway by 6 px", lambda t: _step(t, t.region(t.first("chrome")), 6.0), ("ball", "moved|rolled|flash_00[68]")),
        Mistake("the object moved midway by 5 px", lambda t: _step(t, t.object_mask, 5.0), ("object|moved", "flash_00[68]|from")),
        Mistake("room light on, no ambient frame", lambda t: replace(_with_room(t, 0.25), ambient=None), ("ambient|room",)),
        Mistake("ambient frame at half the exposure", _ambient_scaled(0.5), ("ambient", "expos|bright|dark|room")),
        Mistake("ambient frame at twice the exposure", _ambient_scaled(2.0), ("ambient", "expos|bright|flash")),
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
