"""What a mistake does to the photographs of a session."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.fault_sessions import Taken


def by_flash(taken: Taken) -> NDArray:
    return taken.images - (0 if taken.ambient is None else taken.ambient)


def shifted(image: NDArray, right: float, down: float = 0.0, turn_deg: float = 0.0) -> NDArray:
    height, width = image.shape[:2]
    matrix = cv2.getRotationMatrix2D((width / 2, height / 2), turn_deg, 1.0)
    matrix[:, 2] += right, down
    return cv2.warpAffine(image, matrix, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def changed(taken: Taken, change: Callable[[NDArray], NDArray], which: slice | list[int] = slice(None)) -> Taken:
    """Return the session with some flash frames changed; all: the ambient frame, too."""
    images = taken.images.copy()
    images[which] = np.stack([change(image) for image in images[which]])
    everything = which == slice(None) and taken.ambient is not None
    return replace(taken, images=images, ambient=change(taken.ambient) if everything else taken.ambient)  # type: ignore[arg-type]


def second_half(taken: Taken) -> slice:
    return slice(len(taken.images) // 2, None)


def moved_midway(right: float, turn_deg: float = 0.0) -> Callable[[Taken], Taken]:
    return lambda taken: changed(taken, lambda image: shifted(image, right, right / 3, turn_deg), second_half(taken))


def one_frame(change: Callable[[NDArray], NDArray]) -> Callable[[Taken], Taken]:
    return lambda taken: changed(taken, change, [3])


def all_frames(change: Callable[[NDArray], NDArray], **more: object) -> Callable[[Taken], Taken]:
    return lambda taken: replace(changed(taken, change), **more)  # type: ignore[arg-type]


def srgb(image: NDArray) -> NDArray:
    linear = np.clip(image, 0, 1)
    return np.where(linear < 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


def curve(image: NDArray) -> NDArray:
    """A raw converter's picture style: sRGB with an S on top."""
    coded = srgb(image)
    return coded + 0.12 * np.sin(2 * np.pi * (coded - 0.5)) / 2


def noisy(image: NDArray, white_e: float) -> NDArray:
    rng = np.random.default_rng(len(image))
    return image + rng.normal(size=image.shape) * np.sqrt(np.maximum(image, 0) / white_e + (5 / white_e) ** 2)


def vignetted(image: NDArray) -> NDArray:
    height, width = image.shape[:2]
    v, u = np.mgrid[:height, :width]
    square = ((u - width / 2) ** 2 + (v - height / 2) ** 2) / ((width / 2) ** 2 + (height / 2) ** 2)
    return (image * (1 - 0.45 * square)[..., None]).astype(np.float32)


def distorted(taken: Taken) -> Taken:
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
    return changed(
        taken,
        lambda image: cv2.remap(
            image, ideal[..., 0].astype(np.float32), ideal[..., 1].astype(np.float32), cv2.INTER_CUBIC
        ),
    )


def stepped(taken: Taken, where: NDArray[np.bool_], right: float) -> Taken:
    """Move what is under a mask, and what is just around it, in the second half of the frames."""
    soft = cv2.GaussianBlur(cv2.dilate(where.astype(np.float32), np.ones((9, 9))), (0, 0), 1.5)[..., None]

    def change(image: NDArray) -> NDArray:
        cover = np.clip(shifted(soft[..., 0], right, right / 3), 0, 1)[..., None]
        return (1 - cover) * image + cover * shifted(image, right, right / 3)

    return changed(taken, change, second_half(taken))


def on_ball(taken: Taken, kind: str, change: Callable[[NDArray, NDArray, NDArray], NDArray]) -> Taken:
    """Change the pixels of the first ball of a kind; `change` takes values, and x, y in radii from its middle."""
    number = taken.first(kind)
    region, place = taken.region(number), taken.places[number]
    v, u = np.nonzero(region)
    x, y = (u - place.center_px[0]) / place.radius_px, (v - place.center_px[1]) / place.radius_px

    def painted(image: NDArray) -> NDArray:
        image = image.copy()
        image[v, u] = change(image[v, u], x, y)
        return image

    return changed(taken, painted)


def stain(values: NDArray, x: NDArray, y: NDArray) -> NDArray:
    return np.where((np.hypot(x - 0.25, y + 0.1) < 0.35)[:, None], 0.55 * values, values)


def scratched(values: NDArray, x: NDArray, y: NDArray) -> NDArray:
    rng = np.random.default_rng(3)
    dull = np.zeros(len(x), bool)
    for angle, off in zip(rng.uniform(0, np.pi, 25), rng.uniform(-0.9, 0.9, 25), strict=True):
        dull |= np.abs(x * np.cos(angle) + y * np.sin(angle) - off) < 0.012
    return np.where(dull[:, None], 0.5 * values + 0.1 * np.median(values), values)


def fingerprint(taken: Taken) -> Taken:
    """Grease over half a chrome ball: what it mirrors is blurred there."""
    place = taken.places[taken.first("chrome")]
    _v, u = np.indices(taken.object_mask.shape)
    greasy = taken.region(taken.first("chrome")) & (u < place.center_px[0])
    return changed(
        taken,
        lambda image: np.where(greasy[..., None], cv2.GaussianBlur(image, (0, 0), 0.12 * place.radius_px), image),
    )


def polarised(taken: Taken) -> Taken:
    """Crossed polarisers: no mirror shows the flash."""
    out = taken
    for number, ball in enumerate(taken.balls):
        if ball["kind"] == "chrome":
            region = taken.region(number, grow_px=2)
            out = changed(
                out,
                lambda image, region=region: np.where(
                    region[..., None], np.minimum(image, 1.3 * np.median(image[region], axis=0) + 0.01), image
                ),
            )
    return out


def with_room(taken: Taken, share: float) -> Taken:
    """Return the session with more of the room's light: the mean flash frame, evenly, so much of it."""
    room = taken.ambient if taken.ambient is not None else 0
    more = share * cv2.GaussianBlur(by_flash(taken).mean(0), (0, 0), 2)
    return replace(taken, images=taken.images + more, ambient=(room + more).astype(np.float32))


def ambient_scaled(factor: float) -> Callable[[Taken], Taken]:
    def change(taken: Taken) -> Taken:
        lit = with_room(taken, 0.25)
        return replace(lit, ambient=lit.ambient * np.float32(factor))  # type: ignore[operator]

    return change


def cropped(taken: Taken, *, told: bool) -> Taken:
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


def turned_pictures(taken: Taken) -> Taken:
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
