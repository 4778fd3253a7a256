"""Pictures for people: photographs with gamma, normals as colours, errors on a stated scale, outlines."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.picture_files import srgb_from_linear
from scene.camera import Camera
from scene.frames import Frames
from scene.map_pictures import PAPER, Image, normal_picture, shrink
from scene.spheres import Sphere

SCALE_ENDS_DEG = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0, 120.0, 180.0)


@dataclass(frozen=True)
class PixelBox:
    """A rectangle of pixels: columns left to right - 1, rows top to bottom - 1; of both only every `step`-th."""

    left: int
    top: int
    right: int
    bottom: int
    step: int = 1

    @property
    def width(self) -> int:
        return self.right - self.left

    @property
    def height(self) -> int:
        return self.bottom - self.top

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns."""
        return slice(self.top, self.bottom, self.step), slice(self.left, self.right, self.step)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of a picture of these pixels."""
        return -(-self.width // self.step), -(-self.height // self.step)

    def of(self, image: NDArray) -> NDArray:
        """Return the box's pixels of an image (H, W, ...)."""
        return np.ascontiguousarray(image[self.slices])

    def frame(self, frames: Frames, index: int) -> NDArray[np.float32]:
        """Return the box's pixels of one photograph, linear (h, w, 3)."""
        rows, columns = self.slices
        return frames.read(rows, [index], columns=columns)[0]

    def shown_width(self, largest: int) -> int:
        """Return the width at which a picture of this box has at most as many pixels as a square of side `largest`."""
        return max(16, min(largest, int((largest**2 * self.width / self.height) ** 0.5)))

    @classmethod
    def around(cls, low: NDArray, high: NDArray, *, width: int, height: int, margin: float) -> "PixelBox":
        """Return the box of pixels low..high (u, v), grown by `margin` of its longer side, inside the image."""
        grow = margin * max(high[0] - low[0], high[1] - low[1], 1)
        left, top = np.clip(np.floor(np.asarray(low) - grow), 0, [width - 1, height - 1]).astype(int)
        right, bottom = np.clip(np.ceil(np.asarray(high) + grow) + 1, [left + 1, top + 1], [width, height]).astype(int)
        return cls(int(left), int(top), int(right), int(bottom))

    @classmethod
    def of_mask(cls, mask: NDArray[np.bool_], *, margin: float) -> "PixelBox":
        """Return the box around a mask's pixels; the whole image where the mask is empty."""
        import cv2

        height, width = mask.shape
        left, top, wide, high = cv2.boundingRect(mask.astype(np.uint8))
        if not wide:
            return cls(0, 0, width, height)
        high_end = np.array([left + wide - 1, top + high - 1])
        return cls.around(np.array([left, top]), high_end, width=width, height=height, margin=margin)


@dataclass(frozen=True)
class Exposure:
    """How linear values become grey: one for all frames, so that a dark frame looks dark."""

    white: float
    balance: NDArray[np.float64]

    @classmethod
    def for_frames(cls, frames: Frames, *, white_value: NDArray | None = None) -> "Exposure":
        """Choose white so that in all but the brightest frames 99 % of the pixels are below it.

        Colours are balanced by the white ball where there is one.
        """
        balance = np.ones(3)
        if white_value is not None and np.isfinite(white_value).all() and (white_value > 0).all():
            balance = np.asarray(white_value, np.float64) / np.mean(white_value)
        samples = [thumbnail(frames, index, 64) / balance for index in range(len(frames))]
        peaks = [np.nanquantile(np.max(sample, -1), 0.99) for sample in samples]
        white = float(np.quantile(peaks, 0.95, method="higher")) if peaks else 1.0
        return cls(max(white, 1e-6), balance)

    @classmethod
    def for_picture(cls, linear: NDArray) -> "Exposure":
        """Take each channel's own white in a picture (h, w, 3): RAW colours are the sensor's, greenish."""
        return cls(1.0, np.maximum(np.quantile(linear, 0.995, axis=(0, 1)), 1e-6).astype(np.float64))

    def develop(self, linear: NDArray) -> Image:
        """Return 8-bit sRGB of linear pixels (h, w, 3)."""
        value = np.nan_to_num(linear / self.balance / self.white)
        return np.round(srgb_from_linear(value) * 255).astype(np.uint8)


def thumbnail(frames: Frames, index: int, width: int, box: PixelBox | None = None) -> NDArray[np.float32]:
    """Return one frame, linear, ambient subtracted, cut to `box` and at most `width` wide.

    Reads every n-th pixel so that four by four samples remain for each pixel shown: a 24-megapixel frame is
    never held whole as float32.
    """
    box = box or PixelBox(0, 0, frames.width, frames.height)
    return shrink(replace(box, step=max(1, box.width // (4 * width))).frame(frames, index), width)


def raking_frame(directions: NDArray) -> int:
    """Return the frame whose light stands nearest to 40 degrees from the axis: shape shows, shadows stay short."""
    zenith = np.degrees(np.arccos(np.clip(directions[:, 2], -1, 1)))
    return int(np.argmin(np.abs(zenith - 40)))


def enlarged(image: Image, times: int) -> Image:
    """Return each pixel as a square: a browser smooths what it enlarges, and pixels are to be seen."""
    return image.repeat(times, 0).repeat(times, 1)


def legend_ball(width: int) -> Image:
    """Return a ball facing the viewer in the colours of `normal_picture`: the key to read them by."""
    camera = Camera.orthographic(width, width)
    normals, _ = Sphere("white", np.full(2, (width - 1) / 2), width / 2 - 1).normals(camera, camera.grid())
    return normal_picture(normals, width)


def colour_scale_end(value_deg: float, *, least: float = 1.0) -> float:
    """Return the least round number of degrees that is neither below the value nor below `least`."""
    return next((end for end in SCALE_ENDS_DEG if end >= max(value_deg, least)), SCALE_ENDS_DEG[-1])


def error_picture(error_deg: NDArray, end_deg: float) -> Image:
    """Return errors as colours, dark 0 to bright `end_deg` and beyond; pale grey where unknown.

    The map is cividis: its lightness rises evenly and it reads alike with colour-blind eyes [Nunez2018].
    """
    import cv2

    codes = np.round(np.clip(np.nan_to_num(error_deg) / end_deg, 0, 1) * 255).astype(np.uint8)
    colours = cv2.applyColorMap(codes, cv2.COLORMAP_CIVIDIS)[..., ::-1]
    return np.where(np.isfinite(error_deg)[..., None], colours, PAPER).astype(np.uint8)


def error_scale_colours(count: int) -> list[tuple[int, int, int]]:
    """Return `count` colours of `error_picture`, from 0 to the end of the scale."""
    return [tuple(colour) for colour in error_picture(np.linspace(0, 1, count)[None], 1.0)[0].tolist()]


def with_colour_scale(picture: Image, end_deg: float, caption: str) -> Image:
    """Return a picture in the colours of `error_picture` with their scale, in degrees, and a caption drawn below it."""
    from PIL import Image as Pillow
    from PIL import ImageDraw, ImageFont

    height, width = len(picture), max(picture.shape[1], 260)
    step, size = width // 5, 6 + width // 50
    shown = Pillow.new("RGB", (width, height + 4 * size + 10), "white")
    shown.paste((PAPER,) * 3, (0, 0, width, height))
    shown.paste(Pillow.fromarray(picture))
    bar = error_picture(np.linspace(0, end_deg, 4 * step)[None].repeat(size, 0), end_deg)
    shown.paste(Pillow.fromarray(bar), (step // 2, height + 4))
    how: Any = {"fill": (40, 40, 40), "font": ImageFont.load_default(size)}
    for part in range(5):
        label = f"{end_deg * part / 4:g}°{'+' * (part == 4)}"
        ImageDraw.Draw(shown).text((step // 2 + part * step, height + 6 + size), label, anchor="ma", **how)
    ImageDraw.Draw(shown).text((step // 2, shown.height - 5), caption, anchor="ld", **how)
    return np.asarray(shown)


def ball_picture(frames: Frames, exposure: Exposure, box: PixelBox, width: int, *, is_mirror: bool) -> Image:
    """Return the crop of a ball, the mean of all frames; of a chrome one in grey, its edge and its highlights seen.

    A mirror shows the table around it, so that brightness hardly tells ball from background. Half of the grey is each
    pixel's rank among the crop's means (histogram equalisation), which lifts small steps such as the edge; half is the
    mean itself, which keeps noise in the dark dark. Highlights, each pixel's brightest value, lie over it as bright as
    they were: one of sixty frames would not show in a mean.
    """
    mean = brightest = np.zeros((box.height, box.width, 3), np.float32)
    for index in range(len(frames)):
        crop = box.frame(frames, index)
        mean, brightest = mean + crop / len(frames), np.maximum(brightest, crop)
    if not is_mirror:
        return exposure.develop(shrink(mean, width))
    grey = np.nan_to_num(shrink(mean, width) / exposure.balance).mean(-1)
    peak = np.nan_to_num(shrink(brightest, width)).mean(-1)
    rank = np.interp(grey, np.sort(grey, axis=None), np.linspace(0, 1, grey.size))
    low, high = np.quantile(grey, [0.02, 0.97])
    level = np.clip((grey - low) / max(high - low, 1e-9), 0, 1)
    shown = np.maximum((rank + level) / 2, np.clip(peak / max(peak.max(), 1e-9), 0, 1))
    return np.repeat(np.round(shown * 255).astype(np.uint8)[..., None], 3, -1)
