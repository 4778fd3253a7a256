"""How exactly a session's twin is rendered, and what there is where no material can be fitted."""

from types import SimpleNamespace

import numpy as np
import pytest

from lab.options import TwinSettings
from lab.twin_step import twin, twin_scene
from scene.camera import Camera
from scene.files import write_npy
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose
from scene.store import Store
from twin.engines.variant import import_mitsuba

pytestmark = pytest.mark.render


@pytest.fixture
def job(tmp_path):
    """A flat square of twelve by twelve pixels, registered and solved."""
    import_mitsuba()
    store = Store(tmp_path)
    camera = Camera(40, 30, 60.0, 60.0, 19.5, 14.5)
    directions = unit(np.array([[0.3, 0.0, 1.0], [-0.3, 0.2, 1.0], [0.0, -0.3, 1.0], [0.1, 0.3, 1.0]]))
    lights = Lights(
        tuple("abcd"), directions, np.ones((4, 3)), reference_point_mm=np.array([0, 0, -300.0]),
        white_value=np.full(3, 0.8),
    )  # fmt: skip
    images = np.full((4, 30, 40, 3), 0.3, np.float32)
    store.save_frames(Frames.from_linear(lights.names, images))
    store.save_camera(camera)
    store.save_lights(lights)
    mask = np.zeros((30, 40), bool)
    mask[9:21, 14:26] = True
    store.save_mask(mask)
    normals = np.where(mask[..., None], np.array([0, 0, 1.0]), np.nan).astype(np.float32)
    store.save_truth(normals, np.zeros(mask.shape, np.float32))
    write_npy(store.path("albedo", "ls.npy"), np.where(mask[..., None], 0.3, np.nan).astype(np.float32).repeat(3, -1))
    square = np.array([[-30, -30, 0], [30, -30, 0], [30, 30, 0], [-30, 30, 0.0]])
    mesh = Mesh(square, np.array([[0, 1, 2], [0, 2, 3]]))
    pose = Pose.from_rotation_translation(np.eye(3), np.array([0, 0, -300.0]))
    store.save_pose(pose, residual_px=0.1, sigma_mm=0.1, sigma_deg=0.1)
    return SimpleNamespace(store=store, twin=TwinSettings(), methods=("ls",), load_scan=lambda: mesh)


@pytest.mark.parametrize(
    ("unexplained", "said", "error"), [(0.012, None, 0.01), (0.056, None, 0.028), (0.056, 0.004, 0.004)]
)
def test_a_rendering_is_no_more_exact_than_its_material(job, monkeypatch, unexplained, said, error):
    import twin.material.scan_material
    import twin.scan_scene

    found = SimpleNamespace(relative_rmse=unexplained, fit=None, albedo=None, facts=dict, warnings=())
    monkeypatch.setattr(twin.material.scan_material, "scan_material", lambda *_, **__: found)
    monkeypatch.setattr(twin.scan_scene, "scan_scene", lambda sight, albedo, sampling, **_: (sampling, []))
    job.twin = TwinSettings(error=said)
    sampling = twin_scene(job)[0]
    assert sampling.error == pytest.approx(error)


def test_without_a_material_there_is_no_twin_and_it_is_said(job):
    outcome = twin(job)
    assert outcome.result == {"rendered": False}
    assert [text for text in outcome.warnings if "There is no twin. material: " in text] == outcome.warnings
