"""For AliceVision's Meshroom: SfMData (.sfm) of photographs from one place: views, one camera, one pose; the lights."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scene.camera import Camera, to_opencv
from scene.errors import CalibrationError
from scene.files import write_json
from scene.lights import Lights

VERSION = ["1", "2", "6"]
SENSOR_MM = 36.0
"""Width of the sensor that is stated: only the focal length's ratio to it says anything."""


def write_sfm(path: Path, camera: Camera, photographs: Sequence[Path]) -> list[str]:
    """Write all photographs as views of one camera that stands in the origin; return notes.

    The world is the camera's frame as OpenCV has it: x right, y down, z away. Views count from 1, in the order given.
    The focal length is in millimetres of a sensor `SENSOR_MM` wide, the principal point, pixels, from the middle of the
    picture as AliceVision counts it, half a pixel right and down of ours. In this version the camera's type names the
    model of its distortion: "radial3" has k1, k2, k3 as OpenCV has them, "brown" p1 and p2 after them.

    Raises
    ------
    CalibrationError
        The camera is orthographic, which SfMData has no word for.
    """
    if camera.is_orthographic:
        raise CalibrationError(
            "camera: it is taken as orthographic, and SfMData takes a focal length. Give fx, fy, cx, cy under [camera]."
        )
    k1, k2, p1, p2, k3 = camera.distortion
    kind, distortion = ("brown", (k1, k2, k3, p1, p2)) if p1 or p2 else ("radial3", (k1, k2, k3))
    focal = camera.fx / camera.width * SENSOR_MM
    offset = camera.cx - camera.width / 2, camera.cy - camera.height / 2
    size = {"width": str(camera.width), "height": str(camera.height)}
    intrinsic = {
        "intrinsicId": "1", **size, "sensorWidth": str(SENSOR_MM),
        "sensorHeight": repr(SENSOR_MM * camera.height / camera.width), "serialNumber": "rgbn", "type": kind,
        "initializationMode": "calibrated", "initialFocalLength": repr(focal), "focalLength": repr(focal),
        "pixelRatio": repr(camera.fy / camera.fx), "pixelRatioLocked": "true",
        "principalPoint": list(map(repr, offset)),
        "distortionInitializationMode": "calibrated",
        "distortionParams": [repr(float(value)) for value in distortion], "locked": "true",
    }  # fmt: skip
    views = [
        {"viewId": str(index), "poseId": "1", "frameId": str(index), "intrinsicId": "1", "path": str(one), **size}
        for index, one in enumerate(photographs, 1)
    ]
    turn = {"rotation": ["1", "0", "0", "0", "1", "0", "0", "0", "1"], "center": ["0", "0", "0"]}
    pose = {"poseId": "1", "pose": {"transform": turn, "locked": "1"}}
    data = {"version": VERSION, "views": views, "intrinsics": [intrinsic], "poses": [pose]}
    write_json(path, data)
    return [f"cameras.sfm: its camera is from {camera.source}"]


def sfm_lights(lights: Lights) -> dict[str, Any]:
    """Return what AliceVision's PhotometricStereo reads: distant lights, its camera frame, the views of `write_sfm`."""
    rows = zip(lights.names, to_opencv(lights.directions), lights.intensities, strict=True)
    # Not lights.json: beside ours it would be taken for it.
    return {"lights_alicevision.json": {"lights": [
        {"viewId": view, "type": "directional", "direction": direction, "intensity": intensity, "name": name}
        for view, (name, direction, intensity) in enumerate(rows, 1)
    ]}}  # fmt: skip
