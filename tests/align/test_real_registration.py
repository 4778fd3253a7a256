"""Objects that nobody here photographed or scanned, at poses that others gave them.

The captures are not part of this project; what a surface is that was made from normals: `benchmarks/real_surfaces.py`.
"""

import numpy as np
import pytest

from align.pose.photographed import Photographs
from align.pose.picks import misses_px, read_picks
from benchmarks.real_surfaces import DISTANCE_MM, diligent_object, integrated, mirrored, moved_scan, ycb_objects
from benchmarks.registration import register_on
from fixtures.lit_surfaces import ball_seen
from scene.camera import Camera
from scene.errors import AlignError
from scene.mesh import Mesh
from solve.solve import solve


@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_a_balls_normals_become_a_ball(projection):
    """Every vertex at one distance from one centre, and that centre seen where the ball was."""
    camera = Camera(80, 70, 1000.0, 1000.0, 38.0, 33.0)
    middle = np.array([1.0, -2.0, -DISTANCE_MM])
    if projection == "orthographic":
        camera = Camera.orthographic(80, 70)
    radius = 25.0 if camera.is_orthographic else 40.0
    # Its limb is left out: what is steep there has no depth.
    _, normals, mask = ball_seen(camera, middle, radius, rim=0.3)
    mesh = integrated(np.where(mask[..., None], normals, np.nan), mask, camera)
    system = np.column_stack([2 * mesh.vertices, np.ones(len(mesh.vertices))])
    fitted = np.linalg.lstsq(system, np.sum(mesh.vertices**2, 1), rcond=None)[0]
    away = np.linalg.norm(mesh.vertices - fitted[:3], axis=1)
    # Perspective: normals tell no scale, so centre and radius share one factor.
    scale = 1.0 if camera.is_orthographic else fitted[2] / middle[2]
    assert scale == pytest.approx(1, abs=0.05)
    np.testing.assert_allclose(fitted[:2], scale * middle[:2], atol=0.05)
    np.testing.assert_allclose(away, scale * radius, rtol=0.01)
    toward = np.einsum("tk,tk->t", mesh.face_normals, mesh.vertices[mesh.faces[:, 0]] - fitted[:3])
    assert toward.min() > 0


@pytest.fixture(scope="module")
def cat(shared):
    shared("real/diligent/catPNG")
    return diligent_object("cat", "perspective", shots=8)


def run(made, scan, pose):
    normals = solve("iterative", made.frames, made.lights, made.camera, made.mask).normals
    return register_on(Photographs(made.camera, made.frames, made.lights, made.mask), normals, scan, pose)


@pytest.mark.slow
@pytest.mark.full
def test_the_cat_is_found_on_its_photographs(cat):
    """Half a pixel from where DiLiGenT's makers put it by hand. All frames: docs/evidence/registration.md."""
    found = run(cat, *moved_scan(cat.surface, 10_001))
    assert found["apart_px"] < 1
    assert found["turn_deg"] < 1
    assert found["found"].evidence["overlap"] > 0.98
    assert not found["ambiguous"]


@pytest.mark.slow
@pytest.mark.full
def test_surfaces_that_are_not_the_cats_are_refused(cat):
    """A mirror image, and the ball: the one's outline is the cat's own from behind, the other's is a circle."""
    ball = diligent_object("ball", "perspective", shots=1).surface
    for surface in (mirrored(cat.surface), ball):
        assert run(cat, *moved_scan(surface, 10_002))["refused"]


@pytest.fixture(scope="module")
def table_top(shared):
    shared("real/ycbv")
    return ycb_objects()


def test_ycb_poses_are_in_this_projects_frame(table_top):
    """The set's README: scan points fall inside their label to 0.94-0.99, 0.74 where occluded; pixels from its maps."""
    assert len(table_top) == 3
    for made, share in zip(table_top, (0.97, 0.72, 0.97), strict=True):
        assert made.camera.project(made.pose.apply(made.seen))[made.label] == pytest.approx(
            made.camera.grid()[made.label], abs=0.02
        )
        u, v = np.round(made.camera.project(made.pose.apply(made.points))).astype(int).T
        assert made.label[v, u].mean() > share


def test_picks_on_a_real_photograph(table_top, tmp_path):
    """Ten picks a pixel off, in metres as the set's scans are; one of them on another object's pixel, found out."""
    for made in table_top:
        generator = np.random.default_rng(10_000)
        rows, columns = np.nonzero(made.label)
        chosen = generator.choice(len(rows), 10, replace=False)
        points = made.seen[rows[chosen], columns[chosen]]
        pixels = np.stack([columns, rows], -1)[chosen] + generator.standard_normal((10, 2))
        pixels[3] += [60, -45]
        path = tmp_path / f"{made.name}.csv"
        np.savetxt(
            path, np.column_stack([pixels, points / 1000]), delimiter=",", header="u,v,x,y,z", comments="", fmt="%.9f"
        )
        # The scan of a box or a mug without its faces: triangles enough that a pick lies on one.
        corners = np.concatenate([made.seen[made.label][:, None]] * 3, 1) + np.eye(3)
        mesh = Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        found = read_picks(path, made.camera, mesh, unit="m")
        off = found.pose @ made.pose.inverse()
        assert off.angle_deg() < 4
        right = np.arange(10) != 3
        misses = misses_px(made.pose, made.camera, points[right], pixels[right])
        # No other pose fits nine picks better, not even the set's own.
        assert found.residual_px <= np.sqrt(np.mean(misses**2))
        apart = misses_px(found.pose, made.camera, made.points, made.camera.project(made.pose.apply(made.points)))
        assert np.sqrt(np.mean(apart**2)) < 5
        assert "row 5 was left out" in found.warnings[0]
        pixels[:5] += [80, 0]
        np.savetxt(path, np.column_stack([pixels, points / 1000]), delimiter=",", header="u,v,x,y,z", comments="")
        with pytest.raises(AlignError, match="contradict"):
            read_picks(path, made.camera, mesh, unit="m")
