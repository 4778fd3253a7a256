"""The outline's edges: where the photographs show them, and where they would lie if the scan were where it seems to be.

Toward its outline an object darkens as its surface turns away, and a lens blurs the edge: the steepest place of its
profile lies some tenths of a pixel inside the outline, more on a ball than on a box. Taken for the outline, it passes
for depth. The scan tells the profile: its normals inside the outline, under the lights, next to what the photographs
show beyond.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.appearance import Appearance, Lit
from align.pose.photographed import Photographs
from align.pose.scan_view import Outline, View, box_of, sample
from scene.lights import Lights
from scene.robust import spread

Array = NDArray[np.float64]

SECTORS = 8
"""Directions in the image; an edge is looked for in the frames whose light comes from its own side: the outline is
lit there, and the object's shadow falls to the other side."""
AXES = np.stack([turn(2 * np.pi * np.arange(SECTORS) / SECTORS) for turn in (np.cos, np.sin)], -1)
"""(SECTORS, 2) unit vectors of these directions."""
MARGIN_PX = 32
SPACING_PX = 0.25
BLUR_PX = 1.0
"""Lens, pixel and demosaicing together. Twice as much moves the expected edge by less than a tenth of a pixel."""
SMOOTHING_PX = 0.8
"""Of the slope along a profile."""
INSIDE_PX, OUTSIDE_PX = (-5.0, -1.5), (1.5, 5.0)
"""Where, beside an edge, the object's and the backdrop's brightness are read."""
CONTRAST = 0.2
STILL_PX, STILL = 0.75, 0.5
"""An outline's edge stands still: at least in this share of the other directions' pictures that show one, it lies as
near to where it was found. A shadow's border does not."""
FARTHEST_PX = 2.5
"""An edge expected farther inside is the border of the object's own shadow, not its outline."""


@dataclass(frozen=True)
class EdgePictures:
    """For each direction in the image the mean of the frames lit from there, gray, light for light of intensity one.

    Means, and no maxima: of what object and backdrop add to a pixel of the edge, each is the same mean.
    """

    pictures: NDArray[np.float32]
    """(S, h, w)."""
    corner: NDArray[np.int64]
    """(2,): pixel (u, v) of pictures[:, 0, 0]."""
    members: NDArray[np.bool_]
    """(S, N): the frames of each."""

    @classmethod
    def of(cls, photographs: Photographs) -> "EdgePictures":
        """Take the pictures about the mask, in one pass over the frames."""
        frames, lights = photographs.frames, photographs.lights
        down, columns = box_of(photographs.mask, margin=MARGIN_PX)
        # Image axes: u along the camera's x, v against its y.
        score = AXES @ (lights.directions[:, :2] * [1.0, -1.0]).T
        keep = min(len(frames), max(3, len(frames) // 4))
        members = np.zeros(score.shape, bool)
        np.put_along_axis(members, np.argsort(-score, axis=1)[:, :keep], True, axis=1)
        pictures = np.zeros((SECTORS, down.stop - down.start, columns.stop - columns.start), np.float32)
        weight = (1 / lights.intensities / 3 / keep).astype(np.float32)
        for band in frames.bands(64 << 20):
            rows = slice(max(band.start, down.start), min(band.stop, down.stop))
            if rows.start >= rows.stop:
                continue
            there = slice(rows.start - down.start, rows.stop - down.start)
            for index in np.flatnonzero(members.any(0)).tolist():
                gray = frames.read(rows, [index], columns=columns)[0] @ weight[index]
                for sector in np.flatnonzero(members[:, index]):
                    pictures[sector, there] += gray
        return cls(pictures, np.array([columns.start, down.start]), members)

    def locate(self, pixels: NDArray, outward: NDArray, *, reach_px: float) -> Array:
        """Return how far outside each of K pixels an edge lies (K,), px along `outward`; NaN where there is none.

        The edge is where the profile is steepest, to a fraction of a pixel by a parabola through the slope's peak. Not
        where it crosses half of the contrast: shading slopes inside the outline, and would bend that level. What does
        not stand still (`STILL`) is none.
        """
        half = int(np.ceil((reach_px + 2) / SPACING_PX))
        along = SPACING_PX * np.arange(-half, half + 1)
        own = _sector_of(outward)
        found = [
            _steepest(along, self._profiles(pixels, outward, along, (own + turn) % SECTORS), reach_px)
            for turn in range(SECTORS)
        ]
        others = np.stack(found[1:])
        near = (np.abs(others - found[0]) < STILL_PX).sum(0)
        return np.where(near >= STILL * np.isfinite(others).sum(0), found[0], np.nan)

    def expect(self, view: View, lights: Lights, look: Appearance, outline: Outline, located: NDArray) -> Array:
        """Return where `locate` would find the edge of the viewed scan (K,), px.

        The brightness to both sides is read where the edge was `located` (K,). Inside, the sector's mean of what the
        scan shows by its appearance, times the albedo that fits the photographs near the edge; outside, what they show
        there; the step blurred. Where the scan does not tell (a hole, a part too thin), what is expected in the middle,
        where those that tell nothing count as zero.
        """
        from scipy.ndimage import gaussian_filter1d

        edge = outline.pixels + np.nan_to_num(located)[:, None] * outline.outward
        half = int(np.ceil((FARTHEST_PX + 3.5) / SPACING_PX))
        # Midway between samples: the outline itself lies at 0.
        along = SPACING_PX * (np.arange(-half, half) + 0.5)
        inside, lit = along < 0, (along > INSIDE_PX[0]) & (along < INSIDE_PX[1])
        outside = (along > OUTSIDE_PX[0]) & (along < OUTSIDE_PX[1])
        seen = self._profiles(edge, outline.outward, along, _sector_of(outline.outward))
        shading = self._shading(view, lights, look, outline, along[inside])
        model, measured = shading[:, lit[inside]], seen[:, lit]
        albedo = (model * measured).sum(1) / np.maximum((model * model).sum(1), 1e-12)
        beyond = np.broadcast_to(np.median(seen[:, outside], axis=1)[:, None], (len(edge), int((~inside).sum())))
        profile = np.concatenate([albedo[:, None] * shading, beyond], 1)
        known = np.isfinite(profile).all(1)
        blurred = gaussian_filter1d(np.nan_to_num(profile), BLUR_PX / SPACING_PX, axis=1, mode="nearest")
        expected = np.where(known, _steepest(along, blurred, FARTHEST_PX), np.nan)
        return np.where(np.isfinite(expected), expected, np.median(np.nan_to_num(expected)) if len(expected) else 0.0)

    def _shading(self, view: View, lights: Lights, look: Appearance, outline: Outline, along: NDArray) -> Array:
        """Return (K, M), the scan's shading in each outline point's sector at places `along` its normal."""
        pixels = outline.pixels[:, None] + along[:, None] * outline.outward[:, None]
        origins, directions = view.camera.rays(pixels.reshape(-1, 2))
        points, normals = view.surface(origins, directions)
        known, sector = np.isfinite(normals[:, 0]), np.repeat(_sector_of(outline.outward), len(along))
        out = np.full(len(points), np.nan)
        for index, members in enumerate(self.members):
            here = known & (sector == index)
            lit = Lit.of(lights.toward(points[here])[members], -directions[here])
            out[here] = look.only(members).predict(lit, normals[here]).clip(0).mean(0)
        return out.reshape(len(pixels), len(along))

    def _profiles(self, pixels: NDArray, outward: NDArray, along: NDArray, sector: NDArray[np.int64]) -> Array:
        """Return (K, M), what the pictures of each pixel's `sector` (K,) show at places `along` (M,) its normal."""
        at = pixels[:, None] + along[:, None] * outward[:, None] - self.corner
        sector = np.broadcast_to(sector[:, None, None], (*at.shape[:2], 1))
        return sample(self.pictures, np.concatenate([at, sector], -1))


@dataclass(frozen=True)
class OutlineEdges:
    """Where the photographs show the outline of a scan at one pose, and how far the scan's lies from it."""

    on_scan: Array
    """(K, 3), mm, scan frame: the outline's points that have an edge in the picture."""
    pixels: Array
    """(K, 2): where those edges are."""
    outward: Array
    """(K, 2)."""
    bias_px: float
    """How far outside the picture's edges the scan's outline lies on the whole."""
    apart_px: float
    """Median distance from the scan's outline to the picture's edges."""
    sigma_px: float
    """Robust, after the common offset."""
    residual_px: float
    """Rms of the inliers, after the common offset."""

    @classmethod
    def of(cls, on_scan: Array, pixels: Array, outward: Array, offset: Array) -> "OutlineEdges":
        """Judge K edges by how far inside them the outline lies, `offset` (K,), px."""
        if not len(offset):
            return cls(on_scan, pixels, outward, 0.0, np.inf, np.inf, np.inf)
        bias = -float(np.median(offset))
        beside = offset + bias
        sigma = max(spread(beside), 0.05)
        residual = float(np.sqrt(np.mean(beside[np.abs(beside) < 3 * sigma] ** 2)))
        return cls(on_scan, pixels, outward, bias, float(np.median(np.abs(offset))), sigma, residual)


def _sector_of(outward: NDArray) -> NDArray[np.int64]:
    return np.argmax(outward @ AXES.T, axis=1)


def _steepest(along: NDArray, profile: Array, reach_px: float) -> Array:
    """Return where profiles (K, M) at places `along` (M,) are steepest, within the reach; NaN without an edge."""
    from scipy.ndimage import convolve1d

    kernel_at = SPACING_PX * np.arange(-int(3 * SMOOTHING_PX / SPACING_PX), int(3 * SMOOTHING_PX / SPACING_PX) + 1)
    kernel = -kernel_at * np.exp(-0.5 * (kernel_at / SMOOTHING_PX) ** 2)
    slope = convolve1d(profile, kernel, axis=1, mode="nearest")
    inner = np.median(profile[:, along < INSIDE_PX[1]], axis=1)
    outer = np.median(profile[:, along > OUTSIDE_PX[0]], axis=1)
    # Falling outward where the object is brighter, rising where the backdrop is.
    slope *= np.where(inner > outer, -1, 1)[:, None]
    slope[:, np.abs(along) > reach_px] = -np.inf
    peak = np.argmax(slope, axis=1)
    row = np.arange(len(profile))
    found = (peak > 0) & (peak < len(along) - 1)
    found &= np.abs(inner - outer) > CONTRAST * np.maximum(inner, outer)
    left, top, right = (slope[row, np.clip(peak + d, 0, len(along) - 1)] for d in (-1, 0, 1))
    # A peak at the window's end is the flank of an edge that lies beyond it.
    found &= np.isfinite(left) & np.isfinite(right) & (top > 0)
    bend = np.where(found, left - 2 * top + right, -1.0)
    shift = np.where(found, 0.5 * (left - right), 0.0) / np.where(bend < 0, bend, -1.0)
    return np.where(found, along[peak] + SPACING_PX * np.clip(shift, -1, 1), np.nan)
