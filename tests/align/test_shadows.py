"""Cast shadows: what is asked of the ray caster."""

import numpy as np

from align.pose.scan_view import View
from align.pose.shading import find_shadows
from scene.rays import RayCaster


def test_only_known_surface_is_asked_for_shadows(world, monkeypatch):
    """Points without a normal (the inside, through a hole) sent rays of NaN, a thousand times as slow as others."""
    pixels = np.argwhere(world.mask)[::7, ::-1].astype(float)
    view = View(RayCaster(world.mesh), world.camera, world.pose)
    points, normals = view.surface(*view.camera.rays(pixels))
    whole = find_shadows(view, world.lights, points, normals)
    assert 0.01 < whole.mean() < 0.5
    asked, blocked = [], RayCaster.blocked

    def listening(self, start, toward, far):
        asked.append(len(start))
        assert np.isfinite(start).all()
        return blocked(self, start, toward, far)

    monkeypatch.setattr(RayCaster, "blocked", listening)
    normals[::3] = np.nan
    points[1::5] = np.nan
    known = np.isfinite(normals[:, 0]) & np.isfinite(points[:, 0])
    found = find_shadows(view, world.lights, points, normals)
    assert set(asked) == {known.sum()}
    np.testing.assert_array_equal(found, whole & known)
