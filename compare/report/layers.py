"""The object's pixels as pictures that people see and the viewer reads values from: one grid of pixels for all.

A picture's colour is its value's code: photographs and albedo in sRGB, normals (n + 1) / 2, angles by their
place in a palette.
"""

import base64
import io
from dataclasses import dataclass, field

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from compare.report import page, pictures
from compare.report.facts import Material, Summary, read_optional
from compare.report.pictures import Exposure, PixelBox
from scene.errors import SceneError
from scene.frames import Frames
from scene.map_pictures import PAPER, data_uri, known_pixels, normal_picture
from scene.store import Store

LEVELS = 255
"""Of an angle's palette; one more stands for unknown."""
MOST_PIXELS = 400_000
MOST_BYTES = 5_500_000
"""Of all pictures, before base64 makes four thirds of them."""
ALBEDO_QUANTILE = 0.999


@dataclass(frozen=True)
class Grid:
    """Every `step`-th pixel of a box: a value shown is that of one pixel, not a mean."""

    box: PixelBox
    step: int

    def of(self, image: NDArray) -> NDArray:
        """Return the grid's pixels of a map (H, W, ...)."""
        return np.ascontiguousarray(image[self.box.top : self.box.bottom : self.step, self.columns])

    @property
    def columns(self) -> slice:
        """Columns of the photographs."""
        return slice(self.box.left, self.box.right, self.step)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the pictures."""
        return -(-self.box.width // self.step), -(-self.box.height // self.step)

    def frame(self, frames: Frames, index: int) -> NDArray[np.float32]:
        """Return the grid's pixels of one photograph, linear (h, w, 3)."""
        rows = slice(self.box.top, self.box.bottom, self.step)
        return frames.read(rows, [index], columns=self.columns)[0]


@dataclass(frozen=True)
class Layer:
    """One picture of the grid. `kind`: photograph, normals, error, sigma or albedo; `side`: real, twin or truth."""

    kind: str
    side: str
    name: str
    label: str
    uri: str

    @property
    def html(self) -> Markup:
        """The still picture; the viewer finds it by its data."""
        return Markup(
            '<figure class="map"><img data-kind="{0.kind}" data-side="{0.side}" data-name="{0.name}" src="{0.uri}" '
            'alt="{0.label}"><figcaption>{0.label}</figcaption></figure>'
        ).format(self)


@dataclass(frozen=True)
class ViewerLayers:
    """All pictures of a folder on one grid, and what turns their colours into values again."""

    grid: Grid
    layers: list[Layer] = field(default_factory=list)
    scales: Summary = field(default_factory=dict)

    def html(self, kind: str, *sides: str) -> Markup:
        """Return the pictures of a kind."""
        return Markup("").join(
            layer.html for layer in self.layers if layer.kind == kind and layer.side in (sides or (layer.side,))
        )

    @classmethod
    def of(cls, material: Material, summary: Summary) -> "ViewerLayers | None":
        """Return the folder's pictures; None where there are neither photographs nor normals."""
        shape = _shape(material)
        if shape is None:
            return None
        box = PixelBox.of_mask(shape, margin=0.04)
        sides = {"real": material.frames, "twin": _twin_frames(material, shape.shape)}
        count = sum(len(frames) for frames in sides.values() if frames is not None)
        layers = cls(Grid(box, _step(material, box, count)))
        for side, frames in sides.items():
            layers._photographs(material, frames, side)
        compared = summary.get("compare") or {}
        layers._maps(material, compared.get("error_scale_deg"), shape.shape)
        return layers

    def _photographs(self, material: Material, frames: Frames | None, side: str) -> None:
        """Add a side's photographs; its scale has what JPEG costs 95 % of samples at most, as a share of white."""
        if frames is None or not len(frames):
            return
        exposure, words = material.exposure, "photograph"
        if side == "twin" or exposure is None:
            balance = None if exposure is None else exposure.balance
            exposure, words = Exposure.for_frames(frames, white_value=balance), "twin"
        for index, name in enumerate(frames.names):
            image = exposure.develop(self.grid.frame(frames, index))
            label = f"{words} {index + 1}, {name}"
            self.layers.append(Layer("photograph", side, str(index), label, data_uri(image, photograph=True)))
        scale = {"white": exposure.white, "balance": exposure.balance.tolist()}
        scale["error_share"] = _jpeg_error(self.grid.frame(frames, 0) / exposure.balance / exposure.white, exposure)
        self.scales[f"photograph-{side}"] = scale

    def _maps(self, material: Material, error_end: float | None, shape: tuple[int, ...]) -> None:
        def there(place: str, name: str) -> NDArray | None:
            found = material.map_of(place, name)
            return found if found is not None and found.shape[:2] == shape[:2] else None

        sigmas: list[tuple[str, str, str, NDArray]] = []
        for name in ["truth", *material.methods]:
            for side, place in {"real": "normals", "twin": "twin/normals"}.items():
                normals = there(place, name)
                if normals is None or (name == "truth" and side == "twin"):
                    continue
                known = "truth" if name == "truth" else side
                of = "ground truth" if name == "truth" else f"{name}, {'photographs' if side == 'real' else 'twin'}"
                image = normal_picture(self.grid.of(normals), self.grid.size[0])
                self.layers.append(Layer("normals", known, name, f"normals, {of}", data_uri(image, photograph=False)))
                error = there("compare", f"error_{side}_{name}")
                if error is not None and page.is_number(error_end):
                    uri = angle_uri(self.grid.of(error), error_end)
                    self.layers.append(Layer("error", known, name, f"error, {of}", uri))
                sigma = there(*(("normals", "truth_sigma") if name == "truth" else ("sigma", name)))
                if sigma is not None and side == "real":
                    sigmas.append((known, name, f"sigma, {of}", self.grid.of(sigma)))
                albedo = there("albedo", name)
                if albedo is not None and side == "real" and albedo.ndim == 3:
                    self._albedo(material, name, self.grid.of(albedo))
        known = [sigma[np.isfinite(sigma)] for *_, sigma in sigmas]
        if any(each.size for each in known):
            end = pictures.colour_scale_end(float(np.quantile(np.concatenate(known), 0.98)), least=0.1)
            self.scales["sigma"] = {"end_deg": end}
            self.layers.extend(
                Layer("sigma", side, name, label, angle_uri(sigma, end)) for side, name, label, sigma in sigmas
            )
        if page.is_number(error_end):
            self.scales["error"] = {"end_deg": error_end}

    def _albedo(self, material: Material, name: str, albedo: NDArray) -> None:
        balance = np.ones(3) if material.exposure is None else material.exposure.balance
        known = (albedo / balance)[np.isfinite(albedo).all(-1)]
        white = max(float(np.quantile(known, ALBEDO_QUANTILE)) if known.size else 1.0, 1e-6)
        image = Exposure(white, balance).develop(np.maximum(albedo, 0))
        self.scales[f"albedo-{name}"] = {"white": white, "balance": balance.tolist()}
        self.layers.append(Layer("albedo", "real", name, f"albedo, {name}", data_uri(image, photograph=False)))


def palette() -> NDArray[np.uint8]:
    """Return (256, 3): the colours of an angle's levels, 0 to the scale's end and beyond, and last that of unknown."""
    return np.array([*pictures.error_scale_colours(LEVELS), (PAPER,) * 3], np.uint8)


def angle_uri(angle_deg: NDArray, end_deg: float) -> str:
    """Return angles (h, w) as a picture of `LEVELS` levels; beyond `end_deg` the last one."""
    from PIL import Image

    codes = np.round(np.clip(np.nan_to_num(angle_deg) / end_deg, 0, 1) * (LEVELS - 1))
    image = Image.fromarray(np.where(np.isfinite(angle_deg), codes, LEVELS).astype(np.uint8), "L")
    image.putpalette(palette().tobytes())
    buffer = io.BytesIO()
    image.save(buffer, "PNG", optimize=True)
    return f"data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}"


def surface_uri(material: Material, grid: Grid) -> tuple[str, float, float] | None:
    """Return the scan's depth z as a picture (red and green: 16 bits, blue: known), its least value and range, mm."""
    path = material.store.path("twin", "truth_z_mm.npy")
    if not path.exists():
        return None
    z = np.load(path, mmap_mode="r")
    if z.ndim != 2 or (material.mask is not None and z.shape != material.mask.shape):
        return None
    z = grid.of(z).astype(np.float64)
    known = np.isfinite(z) & (z < 0) & (True if material.mask is None else grid.of(material.mask))
    if not known.any():
        return None
    low, span = float(z[known].min()), max(float(np.ptp(z[known])), 1e-6)
    code = np.where(known, np.round((np.nan_to_num(z) - low) / span * 65535), 0).clip(0, 65535).astype(np.uint16)
    image = np.stack([code >> 8, code & 255, known * 255], -1).astype(np.uint8)
    return data_uri(image, photograph=False), low, span


def _shape(material: Material) -> NDArray[np.bool_] | None:
    """Return the mask (H, W) of the object: given, or where normals are known, or all of the photographs."""
    frames, mask = material.frames, material.mask
    normals = [
        found for name in ("truth", *material.methods) if (found := material.map_of("normals", name)) is not None
    ]
    size = (frames.height, frames.width) if frames is not None else None
    if mask is not None and (size is None or mask.shape == size):
        return mask if normals or frames is not None else None
    if size is not None:
        return np.ones(size, bool)
    return known_pixels(normals[0]) if normals else None


def _twin_frames(material: Material, shape: tuple[int, ...]) -> Frames | None:
    try:
        frames = Store(material.store.path("twin")).load_frames()
    except SceneError:
        return None
    return frames if (frames.height, frames.width) == shape[:2] else None


def _step(material: Material, box: PixelBox, frames: int) -> int:
    """Return the least step by which all pictures fit, by the size of one of each."""
    step = int(np.ceil(np.sqrt(max(1.0, box.width * box.height / MOST_PIXELS))))
    grid, size = Grid(box, step), 0
    if material.frames is not None and len(material.frames) and material.exposure is not None:
        image = material.exposure.develop(grid.frame(material.frames, 0))
        size += frames * len(data_uri(image, photograph=True))
    for name in material.methods[:1]:
        normals = material.map_of("normals", name)
        if normals is not None:
            image = normal_picture(grid.of(normals), grid.size[0])
            # Two of normals, one of albedo, and angles, a byte a pixel, count as a third.
            size += 4 * len(material.methods) * len(data_uri(image, photograph=False))
    return max(step, int(np.ceil(step * np.sqrt(size * 0.75 / MOST_BYTES))))


def _jpeg_error(share: NDArray, exposure: Exposure) -> float:
    import cv2

    encoded = exposure.develop(share * exposure.balance * exposure.white)
    done, buffer = cv2.imencode(".jpg", np.ascontiguousarray(encoded[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, 86])
    decoded = np.asarray(cv2.imdecode(buffer, cv2.IMREAD_COLOR))[..., ::-1] / 255 if done else encoded / 255
    linear = np.where(decoded <= 0.04045, decoded / 12.92, ((decoded + 0.055) / 1.055) ** 2.4).mean(-1)
    return float(np.quantile(np.abs(linear - np.clip(np.nan_to_num(share), 0, 1).mean(-1)), 0.95))


def scene_of(material: Material) -> Summary:
    """Return camera, lights and balls as the viewer takes them; missing parts are None."""
    return {name: read_optional(material.store, f"{name}.json") for name in ("camera", "lights", "spheres")}
