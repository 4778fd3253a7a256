"""The twin as a session of its own: a folder that `rgbn process` takes like any capture."""

import glob
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.toml_documents import toml_text
from scene.camera import Camera
from scene.errors import RenderError
from scene.files import write_npy, write_text
from scene.frames import Frames
from scene.lights import Lights
from scene.store import Store
from twin.camera.virtual_camera import NO_FILTER, Sensor
from twin.camera.virtual_photograph import Files, write_photograph

HEADLINE = "# Rendered by rgbn."
"""First line of the session.toml: what may be written over."""

_FIRST_SHOT = datetime(2000, 1, 1, 12, 0)
"""A rendering has no hour: EXIF gets a fixed one, so that the same rendering gives the same files."""


@dataclass(frozen=True)
class Shooting:
    """How rendered frames are photographed.

    Parameters
    ----------
    sensor : Sensor or None
        None: no noise. Else the virtual camera photographs each frame.
    files : {"png", "dng", "exr"} or None
        See `twin.camera.virtual_photograph.write_photograph`. None: DNG of a Bayer sensor, else PNG.
    """

    sensor: Sensor | None = None
    files: Files | None = None


def write_session(
    folder: Store,
    frames: Frames,
    camera: Camera,
    lights: Lights,
    mask: NDArray[np.bool_],
    truth: NDArray[np.float32],
    *,
    shooting: Shooting = Shooting(),
    name: str | None = None,
    ambient: NDArray[np.float32] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write rendered frames, their camera, lights, mask and true normals as a session folder.

    Parameters
    ----------
    folder : Store
        Gets session.toml, flash/<name>.png (or .dng, .exr), ambient/, lights.json with its text forms, mask.png,
        truth.npy.
    lights : Lights
        Of the same names, in the same order.
    mask : (H, W) bool
    truth : (H, W, 3) float32
        Unit normals, camera frame, NaN where unknown.
    name : str or None
        The session's; None: that of the folder around, and "twin".
    ambient : (H, W, 3) float32 or None
        Light that stands still and is in every frame: a photograph without flash goes to ambient/.
    progress : callable or None
        Called with (frames written, frames in all).

    Returns
    -------
    path : Path
        The session.toml. It is written last: where it is, the session is whole.

    Raises
    ------
    RenderError
        Frames and lights, or frames and camera, do not fit together.
    """
    if frames.names != lights.names:
        raise RenderError(
            f"{folder.folder}: frames {', '.join(frames.names[:3])} ... ({len(frames)}) and lights "
            f"{', '.join(lights.names[:3])} ... ({len(lights)}) differ; a session has one light a frame, in one order."
        )
    size = (camera.height, camera.width)
    if not (frames.height, frames.width) == size == mask.shape == truth.shape[:2]:
        raise RenderError(
            f"{folder.folder}: frames {frames.codes.shape[1:3]}, camera {size}, mask {mask.shape} "
            f"and normals {truth.shape[:2]} px: all must agree."
        )
    sensor, files = shooting.sensor, shooting.files
    if files is None:
        files = "png" if sensor is None or sensor.cfa == NO_FILTER else "dng"
    # Without millimetres to pixels (orthographic) a normal lens is as good as any.
    pixel_um = Sensor.pixel_um if sensor is None else sensor.pixel_um
    focal_mm = 50.0 if camera.is_orthographic else camera.fx * pixel_um / 1000

    def shoot(file: str, image: NDArray, index: int) -> str:
        # Each frame's noise is of a stream of its own.
        rng, time = np.random.default_rng([0, index]), _FIRST_SHOT + timedelta(seconds=2 * index)
        write_photograph(folder.path(file), image, sensor, rng, focal_mm=focal_mm, time=time)
        return file

    still = None if ambient is None else shoot(f"ambient/ambient.{files}", ambient, len(frames))
    written = []
    for index, light in enumerate(frames.names):
        written.append(shoot(f"flash/{light}.{files}", frames.frame(index), index))
        if progress is not None:
            progress(index + 1, len(frames))
    folder.save_lights(lights, files=tuple(written))
    folder.save_mask(mask)
    write_npy(folder.path("truth.npy"), np.asarray(truth, np.float32))
    session: dict[str, Any] = {
        "version": 1,
        "name": name or f"{folder.folder.resolve().parent.name} twin",
        # One by one: their order is that of lights.json. A name with brackets is no glob.
        "frames": {
            "flash": [glob.escape(file) for file in written],
            "ambient": still,
            "linear": True if files == "png" else None,
        },
        "lights": {"file": "lights.json"},
        "object": {"mask": "mask.png", "normals": "truth.npy"},
    }
    if not camera.is_orthographic:  # which is what a session without [camera] is taken to be
        session["camera"] = {
            key: getattr(camera, key) for key in ("width", "height", "fx", "fy", "cx", "cy", "distortion")
        }
    path = folder.path("session.toml")
    write_text(path, f"{HEADLINE}\n{toml_text(session)}")
    return path
