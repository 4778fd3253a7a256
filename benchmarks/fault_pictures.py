"""What a mistake does to the photographs of a session."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.fault_sessions import Taken
from scene.camera import Camera

Change = Callable[[NDArray], NDArray]
Make = Callable[[Taken], Taken]


def by_flash(taken: Taken) -> NDArray:
    """Return the frames (F, H, W, 3) without the ambient light."""
    return taken.images - (0 if taken.ambient is None else taken.ambient)


def shifted(image: NDArray, right: float, down: float = 0.0, turn_deg: float = 0.0) -> NDArray:
    """Return a picture moved by some pixels, and turned about its middle."""
    height, width = image.shape[:2]
    matrix = cv2.getRotationMatrix2D((width / 2, height / 2), turn_deg, 1.0)
    matrix[:, 2] += right, down
    return cv2.warpAffine(image, matrix, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def changed(taken: Taken, change: Change, which: slice | list[int]) -> Taken:
    """Return the session with some flash frames changed."""
    images = taken.images.copy()
    images[which] = np.stack([change(image) for image in images[which]])
    return replace(taken, images=images)


def everywhere(taken: Taken, change: Change, **more: Any) -> Taken:
    """Return the session with all frames changed, the ambient one too."""
    ambient = None if taken.ambient is None else change(taken.ambient)
    return replace(changed(taken, change, slice(None)), ambient=ambient, **more)


def all_frames(change: Change, **more: Any) -> Make:
    """Return what changes all frames; `more`: fields of `Taken`."""
    return lambda taken: everywhere(taken, change, **more)


def second_half(taken: Taken) -> slice:
    """Return the frames after the middle of the session."""
    return slice(len(taken.images) // 2, None)


def moved_midway(right: float, turn_deg: float = 0.0) -> Make:
    """Return what moves the camera in the middle of the session."""
    return lambda taken: changed(taken, lambda image: shifted(image, right, right / 3, turn_deg), second_half(taken))


def one_frame(change: Change) -> Make:
    """Return what changes the fourth frame."""
    return lambda taken: changed(taken, change, [3])


def srgb(image: NDArray) -> NDArray:
    """Return linear values encoded as sRGB."""
    linear = np.clip(image, 0, 1)
    return np.where(linear < 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


def curve(image: NDArray) -> NDArray:
    """Return a raw converter's picture style: sRGB with an S on top."""
    coded = srgb(image)
    return coded + 0.06 * np.sin(2 * np.pi * (coded - 0.5))


def noisy(image: NDArray, white_e: float = 30_000) -> NDArray:
    """Return a picture with photon noise, `white_e` electrons at 1, and a read noise of five."""
    rng = np.random.default_rng(len(image))
    return image + rng.normal(size=image.shape) * np.sqrt(np.maximum(image, 0) / white_e + (5 / white_e) ** 2)


def vignetted(image: NDArray) -> NDArray:
    """Return a picture that is 45 % darker at its corners."""
    height, width = image.shape[:2]
    v, u = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    return (image * (1 - 0.225 * (u**2 + v**2))[..., None]).astype(np.float32)


def distorted(taken: Taken) -> Taken:
    """Return the session with a barrel distortion of 2.5 % at the corners."""
    camera = Camera(**taken.camera)
    corner = np.hypot(camera.width, camera.height) / 2 / camera.fx
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    v, u = np.mgrid[: camera.height, : camera.width].astype(np.float64)
    lens = np.array([-0.025 / corner**2, 0, 0, 0, 0])
    ideal = cv2.undistortPoints(np.stack([u, v], -1).reshape(-1, 1, 2), matrix, lens, P=matrix)
    places = ideal.reshape(*u.shape, 2).astype(np.float32)
    return everywhere(taken, lambda image: cv2.remap(image, places, None, cv2.INTER_CUBIC))  # type: ignore[call-overload]


def stepped(taken: Taken, where: NDArray[np.bool_], right: float) -> Taken:
    """Move what is under a mask, and what is just around it, in the second half of the frames."""
    soft = cv2.GaussianBlur(cv2.dilate(where.astype(np.float32), np.ones((9, 9))), (0, 0), 1.5)
    cover = np.clip(shifted(soft, right, right / 3), 0, 1)[..., None]
    return changed(
        taken, lambda image: (1 - cover) * image + cover * shifted(image, right, right / 3), second_half(taken)
    )


def on_ball(kind: str, change: Callable[[NDArray, NDArray, NDArray], NDArray]) -> Make:
    """Return what changes the first ball of a kind; `change` takes values, and x, y in radii from its middle."""

    def make(taken: Taken) -> Taken:
        number = taken.first(kind)
        place, (v, u) = taken.places[number], np.nonzero(taken.region(number))
        x, y = (u - place.center_px[0]) / place.radius_px, (v - place.center_px[1]) / place.radius_px

        def painted(image: NDArray) -> NDArray:
            image = image.copy()
            image[v, u] = change(image[v, u], x, y)
            return image

        return everywhere(taken, painted)

    return make


def stain(values: NDArray, x: NDArray, y: NDArray) -> NDArray:
    """Return a ball's values with a darker spot."""
    return np.where((np.hypot(x - 0.25, y + 0.1) < 0.35)[:, None], 0.55 * values, values)


def scratched(values: NDArray, x: NDArray, y: NDArray) -> NDArray:
    """Return a ball's values with 25 dull lines."""
    rng = np.random.default_rng(3)
    dull = np.zeros(len(x), bool)
    for angle, off in zip(rng.uniform(0, np.pi, 25), rng.uniform(-0.9, 0.9, 25), strict=True):
        dull |= np.abs(x * np.cos(angle) + y * np.sin(angle) - off) < 0.012
    return np.where(dull[:, None], 0.5 * values + 0.1 * np.median(values), values)


def fingerprint(taken: Taken) -> Taken:
    """Put grease over half a chrome ball: what it mirrors is blurred there."""
    number = taken.first("chrome")
    place, greasy = taken.places[number], taken.region(number)
    greasy[:, int(place.center_px[0]) + 1 :] = False
    sigma = 0.12 * place.radius_px
    return everywhere(taken, lambda image: np.where(greasy[..., None], cv2.GaussianBlur(image, (0, 0), sigma), image))


def polarised(taken: Taken) -> Taken:
    """Put crossed polarisers before flash and lens: no mirror shows the flash."""
    regions = [taken.region(i, grow_px=2) for i, ball in enumerate(taken.balls) if ball["kind"] == "chrome"]

    def dimmed(image: NDArray) -> NDArray:
        for region in regions:
            most = 1.3 * np.median(image[region], axis=0) + 0.01
            image = np.where(region[..., None], np.minimum(image, most), image)
        return image

    return everywhere(taken, dimmed)


def lit_room(taken: Taken, share: float = 0.25) -> Taken:
    """Return the session with more of the room's light: the mean flash frame, evenly, so much of it."""
    more = share * cv2.GaussianBlur(by_flash(taken).mean(0), (0, 0), 2)
    room = 0 if taken.ambient is None else taken.ambient
    return replace(taken, images=taken.images + more, ambient=(room + more).astype(np.float32))


def ambient_scaled(factor: float) -> Make:
    """Return what exposes the ambient frame of a bright room otherwise."""

    def make(taken: Taken) -> Taken:
        lit = lit_room(taken)
        return replace(lit, ambient=lit.dark * np.float32(factor))

    return make


def cropped(taken: Taken) -> Taken:
    """Cut an eighth of the pictures off, on the right."""
    width = taken.images.shape[2] * 7 // 8 // 2 * 2
    ambient = None if taken.ambient is None else taken.ambient[:, :width]
    return replace(taken, images=taken.images[:, :, :width], ambient=ambient, mask=None, normals=None)


def turned_pictures(taken: Taken) -> Taken:
    """Turn pictures and [camera] by 90 degrees."""
    was = taken.camera
    camera = {**was, "width": was["height"], "height": was["width"], "cx": was["cy"]}
    camera["cy"] = was["width"] - 1 - was["cx"]
    turn = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    mask = np.ascontiguousarray(np.rot90(taken.object_mask))
    return replace(
        taken, images=np.rot90(taken.images, axes=(1, 2)), camera=camera, vectors=taken.vectors @ turn, mask=mask,
        ambient=None if taken.ambient is None else np.rot90(taken.ambient), object_mask=mask, normals=None, scan=None,
        middle_mm=None if taken.middle_mm is None else taken.middle_mm @ turn, pose=None,
    )  # fmt: skip


def lamp_midway(taken: Taken) -> Taken:
    """Switch a lamp on in the middle of the session: it lights like the second flash, with a third of its power."""
    more = 0.33 * by_flash(taken)[1]
    return changed(taken, lambda image: image + more, second_half(taken))


def half_shadowed(taken: Taken) -> Taken:
    """Let something stand before the flash of three frames: the object's left half is dark."""
    middle = np.nonzero(taken.object_mask)[1].mean()
    left = taken.object_mask & (np.arange(taken.object_mask.shape[1]) < middle)
    share = 1 - 0.95 * cv2.GaussianBlur(left.astype(np.float32), (0, 0), 1.5)[..., None]
    room = 0 if taken.ambient is None else taken.ambient
    return changed(taken, lambda image: room + (image - room) * share, [1, 3, 5])


def grown(growths: Callable[[int], NDArray]) -> Make:
    """Return what enlarges each frame about its middle; `growths` gives the factors (F,) for F frames."""

    def make(taken: Taken) -> Taken:
        height, width = taken.object_mask.shape
        images = []
        for image, growth in zip(taken.images, growths(len(taken.images)), strict=True):
            matrix = cv2.getRotationMatrix2D((width / 2 - 0.5, height / 2 - 0.5), 0.0, float(growth))
            images.append(cv2.warpAffine(image, matrix, (width, height), flags=cv2.INTER_CUBIC,
                                         borderMode=cv2.BORDER_REPLICATE))  # fmt: skip
        return replace(taken, images=np.stack(images))

    return make


def creeping(taken: Taken) -> Taken:
    """Let the first chrome ball creep to the right by 0.35 px a frame."""
    cover = cv2.GaussianBlur(taken.region(taken.first("chrome"), grow_px=4).astype(np.float32), (0, 0), 1.5)[..., None]
    images = [(1 - cover) * image + cover * shifted(image, 0.35 * f) for f, image in enumerate(taken.images)]
    return replace(taken, images=np.stack(images))


def window(taken: Taken) -> Taken:
    """Let a window stand in all chrome balls, as bright as their highlights, and leave the ambient frame away."""
    shine = np.zeros(taken.object_mask.shape, np.float32)
    for place, ball in zip(taken.places, taken.balls, strict=True):
        if ball["kind"] == "chrome":
            u, v = place.center_px + np.array([0.25, -0.35]) * place.radius_px
            half = 0.08 * place.radius_px
            cv2.rectangle(shine, (round(u - half), round(v - half)), (round(u + half), round(v + half)), 1.0, -1)
    most = float(taken.images.max())
    shine = cv2.GaussianBlur(shine, (0, 0), 0.7)[..., None]
    return replace(changed(taken, lambda image: np.maximum(image, most * shine), slice(None)), ambient=None)


def bounced(taken: Taken) -> Taken:
    """Let a wall give back a fifth of each flash's light, from where the second flash is."""
    flashes = by_flash(taken)
    powers = flashes.mean((1, 2, 3))
    more = 0.2 * powers[:, None, None, None] / powers[1] * flashes[1]
    return replace(taken, images=taken.images + more)
