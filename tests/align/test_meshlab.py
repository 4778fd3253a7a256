"""The MeshLab project, read back by MeshLab's own formula."""

import xml.etree.ElementTree as ElementTree

import cv2
import numpy as np
import pytest

from align.meshlab import centred_camera, write_project
from align.scan.mended_scan import load_scan
from scene.camera import Camera
from scene.pose import Pose

CAMERAS = {
    "distorted, off centre": Camera(640, 480, 905.0, 890.0, 370.7, 221.1, (-0.25, 0.1, 0.003, -0.002, 0.0)),
    "orthographic": Camera(640, 480, 3.0, 3.0, 300.0, 255.0, projection="orthographic"),
}


def project(element, points):
    """Return u, v of points (K, 3) by what VCG documents of Shot::Project, from the written text alone."""
    values = {key: np.array([float(word) for word in text.split()]) for key, text in element.attrib.items()}
    rotation = values["RotationMatrix"].reshape(4, 4)[:3, :3]
    c = (points + values["TranslationVector"][:3]) @ rotation.T
    ratio = 1.0 if values["CameraType"] == 1 else values["FocalMm"] / -c[:, 2:]
    xy = c[:, :2] * ratio / values["PixelSizeMm"] + values["CenterPx"]
    height = values["ViewportPx"][1]
    return np.stack([xy[:, 0] - 0.5, height - xy[:, 1] - 0.5], -1)


@pytest.mark.parametrize("name", CAMERAS)
def test_a_mark_on_the_photograph_is_where_meshlab_puts_its_point(bumpy, rotations, tmp_path, name):
    """Through the written numbers, the written scan and the written picture."""
    camera = CAMERAS[name]
    target = np.array([6.0, -4.0, -600.0])
    pose = Pose.from_rotation_translation(rotations[2], target - rotations[2] @ bumpy.center_mm)
    chosen = bumpy.vertices[:: len(bumpy.vertices) // 40]
    seen = camera.project(pose.apply(chosen))
    # A photograph of one soft mark.
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    mark = 250 * np.exp(-((u - seen[7, 0]) ** 2 + (v - seen[7, 1]) ** 2) / (2 * 3.0**2))
    image = np.repeat(mark[..., None], 3, -1).round().astype(np.uint8)
    paths = write_project(tmp_path, bumpy, pose, camera, {"mark & co": image})
    root = ElementTree.parse(paths[0]).getroot()
    element, plane = root.find(".//VCGCamera"), root.find(".//Plane")
    assert element is not None
    assert plane is not None
    mesh = load_scan(tmp_path / str(root.find(".//MLMesh").get("filename")), "mm")
    back = mesh.vertices[np.linalg.norm(mesh.vertices[:, None] - chosen[7], axis=-1).argmin(0)]

    centred = centred_camera(camera)
    assert np.abs(project(element, chosen) - centred.project(pose.apply(chosen))).max() < 0.01
    assert element.get("CenterPx") == f"{centred.width / 2:.0f} {centred.height / 2:.0f}"
    picture = cv2.imread(str(tmp_path / str(plane.get("fileName"))))[..., 0].astype(float)
    assert picture.shape == (centred.height, centred.width)
    v, u = np.mgrid[0 : centred.height, 0 : centred.width]
    middle = np.array([(picture * u).sum(), (picture * v).sum()]) / picture.sum()
    assert np.abs(project(element, back) - middle).max() < 0.05


@pytest.mark.parametrize("name", CAMERAS)
def test_the_centred_picture_holds_the_whole_photograph(name):
    camera, centred = CAMERAS[name], centred_camera(CAMERAS[name])
    corners = camera.grid()[:: camera.height - 1, :: camera.width - 1].reshape(-1, 2)
    origins, directions = camera.rays(corners)
    seen = centred.project(origins + directions)
    assert (seen > -0.51).all()
    assert (seen < [centred.width - 0.49, centred.height - 0.49]).all()
    assert (centred.cx, centred.cy) == ((centred.width - 1) / 2, (centred.height - 1) / 2)
    assert centred.width % 2 == centred.height % 2 == 0
    assert not any(centred.distortion)
    # No larger than it must be.
    assert centred.width < 2 * max(camera.cx + 1, camera.width - camera.cx) * 1.2
