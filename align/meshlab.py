"""The registration as a MeshLab project: scan, photographs, and the equivalent camera.

MeshLab's camera (VCG library, `vcg/math/shot.h` and `camera.h` [Cignoni2008]) sees a point p of the scan at

    c = R (p + t),   X = f c_x / (-c_z) / s + C_x,   Y = f c_y / (-c_z) / s + C_y,

R = RotationMatrix (its rows are the camera's axes: x right, y up, z backward, as ours), t = TranslationVector (minus
the camera's position), f = FocalMm, s = PixelSizeMm, C = CenterPx (whole numbers); orthographic: without f / (-c_z).
X runs from the picture's left edge, Y from its lower one, so that u = X - 1/2 and v = height - Y - 1/2.
Its alignment dialog puts the principal point into the picture's middle whatever the file says. So pictures are
resampled here: no distortion, square pixels, principal point exactly in the middle.
"""

from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from formats.meshes.ply_write import write_ply
from scene.camera import Camera
from scene.files import write_png, write_text
from scene.mesh import Mesh
from scene.pose import Pose

SENSOR_MM = 36.0
"""Width that the picture is given: only its ratio to the focal length counts."""
LARGEST = 2.0
"""A centred picture is at most so many times wider, or higher, than the photograph."""


def centred_camera(camera: Camera) -> Camera:
    """Return a camera of the same place and scale without distortion, with square pixels, centred, of even size.

    Its picture holds the whole photograph: it is padded on the side that the principal point is nearer to.
    """
    u, v = np.linspace(-0.5, camera.width - 0.5, 65), np.linspace(-0.5, camera.height - 0.5, 65)
    border = np.concatenate(
        [
            *(np.stack([u, np.full_like(u, edge)], -1) for edge in (v[0], v[-1])),
            *(np.stack([np.full_like(v, edge), v], -1) for edge in (u[0], u[-1])),
        ]
    )
    origins, directions = camera.rays(border)
    image = origins[:, :2] if camera.is_orthographic else directions[:, :2] / -directions[:, 2:]
    focal = (camera.fx + camera.fy) / 2
    reach = np.abs(image).max(0) * focal
    half = np.ceil(np.minimum(reach, LARGEST / 2 * np.array([camera.width, camera.height])) - 1e-6).astype(int)
    width, height = (2 * int(value) for value in half)
    return Camera(
        width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, projection=camera.projection, source="centred"
    )


def centred_picture(image: NDArray[np.uint8], camera: Camera, centred: Camera) -> NDArray[np.uint8]:
    """Return a photograph (H, W, 3) as `centred` would have taken it; black where it has no pixels."""
    import cv2

    out = np.zeros((centred.height, centred.width, 3), np.uint8)
    step = max(1, (1 << 20) // centred.width)
    for first in range(0, centred.height, step):
        rows = slice(first, min(first + step, centred.height))
        origins, directions = centred.rays(centred.grid(rows))
        at = camera.project(origins + directions).astype(np.float32)
        out[rows] = cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
    return out


def camera_element(pose: Pose, centred: Camera) -> dict[str, str]:
    """Return the attributes of MeshLab's VCGCamera for a centred camera at a pose (camera_from_scan)."""
    position = pose.inverse().translation
    rotation = np.eye(4)
    rotation[:3, :3] = pose.rotation
    if centred.is_orthographic:
        pixel_mm, focal_mm = 1 / centred.fx, 1.0
    else:
        pixel_mm = SENSOR_MM / centred.width
        focal_mm = centred.fx * pixel_mm
    return {
        "TranslationVector": _numbers([*-position, 1.0]),
        "RotationMatrix": _numbers(rotation.ravel()),
        "CameraType": "1" if centred.is_orthographic else "0",
        "FocalMm": _numbers([focal_mm]),
        "PixelSizeMm": _numbers([pixel_mm, pixel_mm]),
        "ViewportPx": f"{centred.width} {centred.height}",
        "CenterPx": f"{centred.width // 2} {centred.height // 2}",
        "LensDistortion": "0 0",
        "BinaryData": "0",
    }


def write_project(
    folder: Path, mesh: Mesh, pose: Pose, camera: Camera, photographs: dict[str, NDArray[np.uint8]]
) -> list[Path]:
    """Write registration.mlp, scan.ply and the photographs, and return their paths, the project's first.

    The mesh is as registered (mended, mm) at `pose` (camera_from_scan); photographs, by name, are (H, W, 3) RGB.
    """
    centred = centred_camera(camera)
    write_ply(folder / "scan.ply", {"x y z": mesh.vertices}, mesh.faces, "millimetres")
    paths = [folder / "registration.mlp", folder / "scan.ply"]
    shot = " ".join(f"{key}={quoteattr(value)}" for key, value in camera_element(pose, centred).items())
    rasters = ""
    for name, image in photographs.items():
        path = folder / f"{name}.png"
        write_png(path, centred_picture(image, camera, centred))
        paths.append(path)
        rasters += (
            f"  <MLRaster label={quoteattr(name)}>\n   <VCGCamera {shot}/>\n"
            f'   <Plane semantic="1" fileName={quoteattr(path.name)}/>\n  </MLRaster>\n'
        )
    identity = "\n".join(" ".join(str(int(value)) for value in row) for row in np.eye(4))
    write_text(
        paths[0],
        "<!DOCTYPE MeshLabDocument>\n<MeshLabProject>\n <MeshGroup>\n"
        '  <MLMesh label="scan" filename="scan.ply">\n'
        f"   <MLMatrix44>\n{identity}\n   </MLMatrix44>\n  </MLMesh>\n </MeshGroup>\n"
        f" <RasterGroup>\n{rasters} </RasterGroup>\n</MeshLabProject>\n",
    )
    return paths


def _numbers(values: list[float] | NDArray) -> str:
    return " ".join(f"{value:.12g}" for value in values)
