"""The output folder: every file of the contract.

Steps hand over through this folder, and so each can be run again alone.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.estimate import Estimate
from scene.files import write_json, write_npy, write_png, write_text
from scene.frames import Frames
from scene.light_text import light_tables, lights_json, lights_of_json, lp_file
from scene.lights import Lights
from scene.normals import encode_normals
from scene.pose import Pose
from scene.reading import array_of, json_of, numbers, positive, reading
from scene.spheres import KINDS, Sphere

REMADE = "Remove it, if it is there, and run the same command again: it is made anew."

MAPS = {
    "albedo": ("albedo", np.float32), "samples": ("samples", np.uint16), "sigma_deg": ("sigma", np.float32),
    "z_mm": ("depth", np.float32),
}  # fmt: skip
"""Of an estimate, but for its normals: the folder of each, and as what it is written. The last two may be unknown."""


@dataclass(frozen=True)
class Store:
    """One session's output folder."""

    folder: Path

    def path(self, *parts: str) -> Path:
        return self.folder.joinpath(*parts)

    def read_json(self, name: str) -> Any:
        return json_of(self.path(name), do=REMADE)

    def read_array(self, *parts: str) -> NDArray:
        """Return an array of the folder as a memory map."""
        return array_of(self.path(*parts), do=REMADE)

    @contextmanager
    def _opened(self, name: str) -> Iterator[Any]:
        """Give what a JSON file holds; whatever the block stumbles over in it is told as damage."""
        data = self.read_json(name)
        with reading(self.path(name), "is damaged", do=REMADE):
            yield data

    def _stack_shape(self) -> tuple[int, ...] | None:
        """Return the shape of the frames (F, H, W, 3) in this folder, or of those that this folder lies in."""
        known = [path for path in (self.path("frames", "codes.npy"), self.path("codes.npy")) if path.is_file()]
        return array_of(known[0], do=REMADE).shape if known else None

    def _of_frames_size(self, path: Path, height: int, width: int) -> None:
        shape = self._stack_shape()
        if shape is not None and shape[1:3] != (height, width):
            raise SceneError(
                f"{path}: is of {width} x {height} px, the frames of {shape[2]} x {shape[1]}: damaged, or of another "
                f"session. {REMADE}"
            )

    def save_frames(self, frames: Frames) -> None:
        """Write frames that are in memory (the decoder writes its memory maps itself)."""
        write_npy(self.path("frames", "codes.npy"), frames.codes)
        self.save_frames_header(frames)

    def save_frames_header(self, frames: Frames) -> None:
        """Write what goes with `frames/codes.npy`; its presence says that decoding ended well."""
        if frames.ambient is not None:
            write_npy(self.path("frames", "ambient.npy"), frames.ambient)
        told = {name: getattr(frames, name) for name in ("names", "gain", "saturation", "is_mosaic")}
        write_json(self.path("frames", "frames.json"), {**told, "has_ambient": frames.ambient is not None})

    def load_frames(self) -> Frames:
        with self._opened("frames/frames.json") as header:
            codes = self.read_array("frames", "codes.npy")
            names, saturation = tuple(map(str, header["names"])), header["saturation"]
            if codes.dtype not in (np.uint16, np.float16) or codes.ndim != 4 or codes.shape[3] != 3:
                raise ValueError(f"codes.npy beside it holds {codes.dtype} {codes.shape}")
            ambient = self.read_array("frames", "ambient.npy") if header["has_ambient"] else None
            if ambient is not None and (ambient.shape != codes.shape[1:] or ambient.dtype != codes.dtype):
                raise ValueError(f"ambient.npy beside it holds {ambient.dtype} {ambient.shape}, not one frame")
            saturation, gain = np.inf if saturation is None else float(saturation), numbers(header["gain"], len(codes))
            return Frames(names, codes, gain, ambient, saturation, bool(header["is_mosaic"]))

    def save_camera(self, camera: Camera) -> None:
        write_json(self.path("camera.json"), asdict(camera))

    def load_camera(self) -> Camera:
        with self._opened("camera.json") as data:
            numbers([data[name] for name in ("width", "height", "fx", "fy", "cx", "cy")], 6, what="width to cy")
            camera = Camera(**{**data, "distortion": tuple(data["distortion"])})
            self._of_frames_size(self.path("camera.json"), camera.height, camera.width)
            return camera

    def save_spheres(self, spheres: list[Sphere], camera: Camera) -> None:
        tells = [bool(sphere.diameter_mm) and not camera.is_orthographic for sphere in spheres]
        centers = [one.center_mm(camera) if told else None for one, told in zip(spheres, tells, strict=True)]
        rows = [asdict(one) | {"center_mm": center} for one, center in zip(spheres, centers, strict=True)]
        write_json(self.path("spheres.json"), rows)

    def load_spheres(self) -> list[Sphere]:
        with self._opened("spheres.json") as rows:
            read = {
                "kind": lambda kind: KINDS[KINDS.index(kind)],
                "center_px": lambda place: numbers(place, 2, what="center_px"), "radius_px": positive,
                "diameter_mm": lambda size: None if size is None else positive(size), "sigma_px": float,
                "score": float, "apart": bool, "diameter_sigma": float,
            }  # fmt: skip
            return [Sphere(**{name: of(row[name]) for name, of in read.items()}) for row in rows]

    def save_lights(self, lights: Lights, *, files: tuple[str, ...] | None = None) -> None:
        """Write lights.json, and the same as DiLiGenT text and .lp, which cannot hold lights of unknown direction.

        Parameters
        ----------
        lights : Lights
        files : tuple of N str, optional
            The photographs' file names, for the formats that name files. Default: the frames' names.
        """
        files = lights.names if files is None else files
        if not lights.is_unknown:
            for name, text in (light_tables(files, lights) | lp_file(files, lights)).items():
                write_text(self.path(name), text)
        self.save_lights_json(lights)

    def save_lights_json(self, lights: Lights) -> None:
        """Write lights.json alone."""
        write_json(self.path("lights.json"), lights_json(lights))

    def load_lights(self) -> Lights:
        with self._opened("lights.json") as data:
            lights, shape = lights_of_json(data), self._stack_shape()
            if shape is not None and len(lights) != shape[0]:
                raise ValueError(f"{len(lights)} lights for {shape[0]} frames")
            for what in ("directions", "intensities")[lights.is_unknown :]:
                numbers(getattr(lights, what), -1, 3, what=what)
            return lights

    def save_pose(
        self, pose: Pose, *, residual_px: float, sigma_mm: float, sigma_deg: float, mm_per_unit: float | None = None
    ) -> None:
        sigmas = {"residual_px": residual_px, "sigma_mm": sigma_mm, "sigma_deg": sigma_deg}
        scale = {} if mm_per_unit is None else {"mm_per_unit": mm_per_unit}
        write_json(self.path("pose.json"), {"camera_from_scan": pose.matrix, **sigmas, **scale})

    def load_pose(self) -> Pose:
        with self._opened("pose.json") as data:
            matrix = numbers(data["camera_from_scan"], 4, 4, what="camera_from_scan")
            if not np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-3):
                raise ValueError("camera_from_scan is no rigid motion")
            return Pose(matrix)

    def load_scan_scale(self) -> float:
        """Return the millimetres per unit of the scan's file that registering found; 1 where the unit was known."""
        if not self.path("pose.json").exists():
            return 1.0
        with self._opened("pose.json") as data:
            return positive(data.get("mm_per_unit", 1.0))

    def save_mask(self, mask: NDArray[np.bool_]) -> None:
        write_png(self.path("mask.png"), mask)

    def load_mask(self) -> NDArray[np.bool_]:
        from PIL import Image

        with reading(self.path("mask.png"), "is damaged", do=REMADE), Image.open(self.path("mask.png")) as picture:
            mask = np.asarray(picture.convert("L")) > 127
        self._of_frames_size(self.path("mask.png"), *mask.shape)
        return mask

    def save_truth(self, normals: NDArray, sigma_deg: NDArray) -> None:
        write_npy(self.path("normals", "truth_sigma.npy"), np.asarray(sigma_deg, np.float32))
        write_png(self.path("normals", "truth.png"), encode_normals(normals))
        write_npy(self.path("normals", "truth.npy"), np.asarray(normals, np.float32))

    def save_estimate(self, estimate: Estimate) -> None:
        name = estimate.method
        write_png(self.path("normals", f"{name}.png"), encode_normals(estimate.normals))
        for field, (folder, kind) in MAPS.items():
            if (known := getattr(estimate, field)) is not None:
                write_npy(self.path(folder, f"{name}.npy"), np.asarray(known, kind))
        write_npy(self.path("normals", f"{name}.npy"), np.asarray(estimate.normals, np.float32))

    def load_normals(self, name: str) -> NDArray[np.float32]:
        """Return normals/<name>.npy (H, W, 3); `truth`, or a method's."""
        path = self.path("normals", f"{name}.npy")
        normals = self.read_array("normals", f"{name}.npy")
        if normals.ndim != 3 or normals.shape[2] != 3:
            raise SceneError(f"{path}: found an array {normals.shape}, expected (height, width, 3). {REMADE}")
        self._of_frames_size(path, *normals.shape[:2])
        return np.array(normals, np.float32)

    def load_estimate(self, name: str, **told: Any) -> Estimate:
        """Return what `save_estimate` kept of a method; `told`: what the summary says of it, by `Estimate`'s names."""
        maps = {
            field: np.array(self.read_array(folder, f"{name}.npy"))
            for field, (folder, _) in MAPS.items()
            if folder in ("albedo", "samples") or self.path(folder, f"{name}.npy").exists()
        }
        return Estimate(name, self.load_normals(name), **maps, **told)
