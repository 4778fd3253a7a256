"""The output folder: every file of the contract.

Steps hand over through this folder, and so each can be run again alone.
"""

import json
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
from scene.light_text import lp_rows, number_rows
from scene.lights import Lights
from scene.normals import encode_normals
from scene.pose import Pose
from scene.spheres import Sphere


@dataclass(frozen=True)
class Store:
    """One session's output folder."""

    folder: Path

    def path(self, *parts: str) -> Path:
        return self.folder.joinpath(*parts)

    def read_json(self, name: str) -> Any:
        return json.loads(self.path(name).read_text())

    def save_frames(self, frames: Frames) -> None:
        """Write frames that are in memory (the decoder writes its memory maps itself)."""
        write_npy(self.path("frames", "codes.npy"), frames.codes)
        self.save_frames_header(frames)

    def save_frames_header(self, frames: Frames) -> None:
        """Write what goes with `frames/codes.npy`; its presence says that decoding ended well."""
        if frames.ambient is not None:
            write_npy(self.path("frames", "ambient.npy"), frames.ambient)
        header = {
            "names": frames.names,
            "gain": frames.gain,
            "saturation": frames.saturation if np.isfinite(frames.saturation) else None,
            "is_mosaic": frames.is_mosaic,
            "has_ambient": frames.ambient is not None,
        }
        write_json(self.path("frames", "frames.json"), header)

    def load_frames(self) -> Frames:
        header = self.read_json("frames/frames.json")
        saturation = header["saturation"]
        return Frames(
            tuple(header["names"]),
            np.load(self.path("frames", "codes.npy"), mmap_mode="r"),
            np.array(header["gain"], np.float64),
            np.load(self.path("frames", "ambient.npy"), mmap_mode="r") if header["has_ambient"] else None,
            np.inf if saturation is None else saturation,
            header["is_mosaic"],
        )

    def save_camera(self, camera: Camera) -> None:
        write_json(self.path("camera.json"), asdict(camera))

    def load_camera(self) -> Camera:
        data = self.read_json("camera.json")
        return Camera(**{**data, "distortion": tuple(data["distortion"])})

    def save_spheres(self, spheres: list[Sphere], camera: Camera) -> None:
        rows = [
            {
                "kind": sphere.kind,
                "center_px": sphere.center_px,
                "radius_px": sphere.radius_px,
                "center_mm": sphere.center_mm(camera) if sphere.diameter_mm and not camera.is_orthographic else None,
                "diameter_mm": sphere.diameter_mm,
                "sigma_px": sphere.sigma_px,
                "score": sphere.score,
                "apart": sphere.apart,
            }
            for sphere in spheres
        ]
        write_json(self.path("spheres.json"), rows)

    def load_spheres(self) -> list[Sphere]:
        return [
            Sphere(
                row["kind"],
                np.array(row["center_px"], np.float64),
                row["radius_px"],
                row["diameter_mm"],
                row["sigma_px"],
                row["score"],
                row["apart"],
            )
            for row in self.read_json("spheres.json")
        ]

    def save_lights(self, lights: Lights, *, files: tuple[str, ...] | None = None) -> None:
        """Write lights.json, and the same as DiLiGenT text and .lp.

        Parameters
        ----------
        lights : Lights
        files : tuple of N str, optional
            The photographs' file names, for the formats that name files. Default: the frames' names.
        """
        files = lights.names if files is None else files
        frames = [
            {
                "name": lights.names[i],
                "direction": lights.directions[i],
                "position_mm": None if lights.positions_mm is None else lights.positions_mm[i],
                "intensity": lights.intensities[i],
                "direction_sigma_deg": lights.direction_sigma_deg[i],
                "intensity_sigma": lights.intensity_sigma[i],
                "flags": lights.flags[i],
            }
            for i in range(len(lights))
        ]
        data = {
            "frames": frames,
            "reference_point_mm": lights.reference_point_mm,
            "ambient": lights.ambient,
            "white_value": lights.white_value,
            "model": lights.model,
        }

        write_text(self.path("light_directions.txt"), number_rows(lights.directions))
        write_text(self.path("light_intensities.txt"), number_rows(lights.intensities))
        write_text(self.path("filenames.txt"), "".join(f"{name}\n" for name in files))
        write_text(self.path("lights.lp"), lp_rows(files, lights.directions))
        write_json(self.path("lights.json"), data)

    def load_lights(self) -> Lights:
        data = self.read_json("lights.json")
        rows = data["frames"]

        def column(name: str) -> NDArray[np.float64]:
            return np.array([np.nan if row[name] is None else row[name] for row in rows], np.float64)

        return Lights(
            tuple(row["name"] for row in rows),
            column("direction"),
            column("intensity"),
            column("position_mm") if data["model"] == "near" else None,
            np.array(data["reference_point_mm"], np.float64),
            column("direction_sigma_deg"),
            column("intensity_sigma"),
            None if data["ambient"] is None else np.array(data["ambient"], np.float64),
            None if data["white_value"] is None else np.array(data["white_value"], np.float64),
            tuple(tuple(row["flags"]) for row in rows),
        )

    def save_pose(
        self, pose: Pose, *, residual_px: float, sigma_mm: float, sigma_deg: float, mm_per_unit: float | None = None
    ) -> None:
        data: dict[str, object] = {
            "camera_from_scan": pose.matrix,
            "residual_px": residual_px,
            "sigma_mm": sigma_mm,
            "sigma_deg": sigma_deg,
        }
        if mm_per_unit is not None:
            data["mm_per_unit"] = mm_per_unit
        write_json(self.path("pose.json"), data)

    def load_pose(self) -> Pose:
        return Pose(np.array(self.read_json("pose.json")["camera_from_scan"], np.float64))

    def load_scan_scale(self) -> float:
        """Return the millimetres per unit of the scan's file that registering found; 1 where the unit was known."""
        return float(self.read_json("pose.json").get("mm_per_unit", 1.0)) if self.path("pose.json").exists() else 1.0

    def save_mask(self, mask: NDArray[np.bool_]) -> None:
        write_png(self.path("mask.png"), mask)

    def load_mask(self) -> NDArray[np.bool_]:
        import cv2

        image = cv2.imread(str(self.path("mask.png")), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise SceneError(f"{self.path('mask.png')}: cannot be read. Run the step `align` again.")
        return image > 127

    def save_truth(self, normals: NDArray, sigma_deg: NDArray) -> None:
        write_npy(self.path("normals", "truth_sigma.npy"), np.asarray(sigma_deg, np.float32))
        write_png(self.path("normals", "truth.png"), encode_normals(normals))
        write_npy(self.path("normals", "truth.npy"), np.asarray(normals, np.float32))

    def save_estimate(self, estimate: Estimate) -> None:
        name = estimate.method
        write_png(self.path("normals", f"{name}.png"), encode_normals(estimate.normals))
        write_npy(self.path("albedo", f"{name}.npy"), np.asarray(estimate.albedo, np.float32))
        maps = (("sigma", estimate.sigma_deg), ("condition", estimate.condition), ("depth", estimate.z_mm))
        for folder, known in maps:
            if known is not None:
                write_npy(self.path(folder, f"{name}.npy"), np.asarray(known, np.float32))
        write_npy(self.path("normals", f"{name}.npy"), np.asarray(estimate.normals, np.float32))

    def load_normals(self, name: str) -> NDArray[np.float32]:
        """Return normals/<name>.npy (H, W, 3); `truth`, or a method's."""
        return np.load(self.path("normals", f"{name}.npy"))
