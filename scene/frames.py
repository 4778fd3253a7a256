"""The stack of photographs, real or rendered: one type for both.

Pixels stay as codes (uint16, or float16 for EXR) in a memory-mapped array. Whoever reads asks for
row bands or single frames and gets linear float32; the whole stack is never held as float32.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

PEDESTAL = 2048
"""uint16 code of black: noise below black is kept, so that dark means stay unbiased."""
WHITE = 62048
"""uint16 code of 1.0, the sensor's white level."""
BAND_PIXELS = 1 << 19
"""Of a frame that are decoded at a time to be shrunk."""


@dataclass(frozen=True)
class Frames:
    """F photographs from one camera, one light each; linear.

    Parameters
    ----------
    names : tuple of F str
        File stems, in order.
    codes : (F, H, W, 3) uint16 or float16
        RGB. uint16: linear = (code - PEDESTAL) / (WHITE - PEDESTAL) * gain; float16: linear = code * gain.
    gain : (F,) float64
        Brings each frame to the session's reference exposure. 1 when all exposures agree.
    ambient : (H, W, 3) uint16 or float16, or None
        The frame without flash, coded alike, at the reference exposure; subtracted on reading.
    saturation : float
        Linear value, before gain, from which a sample is clipped and must not be believed.
    is_mosaic : bool
        Decoded from a Bayer sensor: interpolation spreads a clipped sample over its neighbours.
    """

    names: tuple[str, ...]
    codes: NDArray
    gain: NDArray[np.float64]
    ambient: NDArray | None = None
    saturation: float = 0.98
    is_mosaic: bool = False

    @classmethod
    def from_linear(cls, names: tuple[str, ...], linear: NDArray, *, ambient: NDArray | None = None) -> "Frames":
        """Code linear images (F, H, W, 3) as a sensor would: 16 bits, clipped above white."""
        return cls(
            tuple(names),
            encode(linear),
            np.ones(len(names)),
            None if ambient is None else encode(ambient),
        )

    def __len__(self) -> int:
        return self.codes.shape[0]

    def __repr__(self) -> str:
        ambient = "" if self.ambient is None else ", ambient light subtracted"
        count = f"{len(self)} frame{'s' * (len(self) != 1)}"
        return f"{count} of {self.width} x {self.height} px, {self.codes.dtype}{ambient}"

    @property
    def height(self) -> int:
        return self.codes.shape[1]

    @property
    def width(self) -> int:
        return self.codes.shape[2]

    def some(self, count: int) -> "Frames":
        """Return about `count` of the frames, evenly spaced, without copying a pixel."""
        return self.only(slice(None, None, max(1, round(len(self) / count))))

    def only(self, which: slice | list[int] | NDArray) -> "Frames":
        """Return some of the frames: by a slice, without copying a pixel, their numbers, or a mask (F,)."""
        names = tuple(self.names[i] for i in np.arange(len(self))[which])
        return replace(self, names=names, codes=self.codes[which], gain=self.gain[which])

    def every(self, step: int) -> "Frames":
        """Return every n-th pixel of each frame, copied: pixel u becomes u / n."""
        ambient = None if self.ambient is None else np.ascontiguousarray(self.ambient[::step, ::step])
        return replace(self, codes=np.ascontiguousarray(self.codes[:, ::step, ::step]), ambient=ambient)

    def read(
        self,
        rows: slice = slice(None),
        frames: slice | list[int] = slice(None),
        *,
        columns: slice = slice(None),
        subtract_ambient: bool = True,
    ) -> NDArray[np.float32]:
        """Return linear pixels (f, h, w, 3) float32; negative values are noise below black."""
        linear = decode(self.codes[frames, rows, columns])
        linear *= self.gain[frames].astype(np.float32)[:, None, None, None]
        if subtract_ambient and self.ambient is not None:
            linear -= decode(self.ambient[rows, columns])
        return linear

    def frame(self, index: int, *, subtract_ambient: bool = True) -> NDArray[np.float32]:
        """Return one whole frame (H, W, 3), linear float32."""
        return self.read(frames=[index], subtract_ambient=subtract_ambient)[0]

    def saturated(
        self,
        rows: slice = slice(None),
        frames: slice | list[int] = slice(None),
        *,
        columns: slice = slice(None),
    ) -> NDArray[np.bool_]:
        """Return (f, h, w) bool: a channel is clipped, or was interpolated from a clipped neighbour."""
        first, last, _ = rows.indices(self.height)
        left, right, _ = columns.indices(self.width)
        margin = 1 if self.is_mosaic else 0
        top, edge = max(first - margin, 0), max(left - margin, 0)
        codes = self.codes[frames, top : last + margin, edge : right + margin]
        red, green, blue = np.moveaxis(codes >= self.limit, -1, 0)
        clipped = np.ascontiguousarray(red | green | blue)  # eight times faster than np.any over so short an axis
        if margin:
            import cv2

            for one in clipped.view(np.uint8):
                cv2.dilate(one, np.ones((3, 3), np.uint8), dst=one)
        return clipped[:, first - top :, left - edge :][:, : last - first, : right - left]

    def read_pixels(self, index: int, v: NDArray, u: NDArray) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Return pixels (P, 3) of one frame at rows v (P,) and columns u (P,), as `read`, and whether `saturated` (P,).

        Only these pixels are decoded: for samples spread over a large picture.
        """
        codes = self.codes[index].reshape(-1, 3)
        linear = decode(np.take(codes, v * self.width + u, axis=0))
        linear *= np.float32(self.gain[index])
        if self.ambient is not None:
            linear -= decode(np.take(self.ambient.reshape(-1, 3), v * self.width + u, axis=0))
        clipped = np.zeros(len(v), bool)
        margin = 1 if self.is_mosaic else 0
        for down in range(-margin, margin + 1):
            for right in range(-margin, margin + 1):
                row, column = np.clip(v + down, 0, self.height - 1), np.clip(u + right, 0, self.width - 1)
                red, green, blue = (np.take(codes, row * self.width + column, axis=0) >= self.limit).T
                clipped |= red | green | blue
        return linear, clipped

    @property
    def limit(self) -> float:
        """The code from which a sample is clipped."""
        if self.codes.dtype != np.uint16:
            return self.saturation
        return min(round(self.saturation * (WHITE - PEDESTAL)) + PEDESTAL, 65535)

    def bands(self, budget_bytes: int = 256 << 20) -> Iterator[slice]:
        """Yield row slices whose float32 pixels, over all frames, fit the budget."""
        per_row = len(self) * self.width * 3 * 4
        step = max(1, min(self.height, budget_bytes // max(per_row, 1)))
        for start in range(0, self.height, step):
            yield slice(start, min(start + step, self.height))


def gray(colours: NDArray) -> NDArray:
    """Return the mean (...) over the channels of (..., C); numpy's own mean of so few takes thirty times as long."""
    count = colours.shape[-1]
    return sum((colours[..., i] for i in range(1, count)), start=colours[..., 0]) / count


def encode(linear: NDArray) -> NDArray[np.uint16]:
    """Return uint16 codes of linear values; see `Frames`."""
    codes = np.multiply(linear, np.float32(WHITE - PEDESTAL), dtype=np.float32)
    np.round(codes, out=codes)
    codes += PEDESTAL
    return np.clip(codes, 0, 65535, out=codes).astype(np.uint16)


def decode(codes: NDArray) -> NDArray[np.float32]:
    """Return linear float32 of codes, before gain; see `Frames`."""
    linear = codes.astype(np.float32)
    if codes.dtype == np.uint16:
        linear -= PEDESTAL
        linear *= np.float32(1 / (WHITE - PEDESTAL))
    return linear


def shrunk(codes: NDArray, factor: int) -> NDArray[np.float32]:
    """Return the linear means (H // factor, W // factor, C) of blocks of codes (H, W, C), before gain."""
    import cv2

    height, width = codes.shape[0] // factor, codes.shape[1] // factor
    out = np.empty((height, width, codes.shape[2]), np.float32)
    # A whole frame of floats would be twice the frame.
    rows = max(1, BAND_PIXELS // (factor * codes.shape[1]))
    for start in range(0, height, rows):
        stop = min(start + rows, height)
        band = codes[start * factor : stop * factor, : width * factor]
        # What is linear may be averaged before it is decoded. OpenCV knows no float16.
        band = band if codes.dtype == np.uint16 else band.astype(np.float32)
        out[start:stop] = decode(cv2.resize(band, (width, stop - start), interpolation=cv2.INTER_AREA))
    return out
