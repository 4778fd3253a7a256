"""The scale of a scan: its unit, one that cannot be right, none, and a ball of known diameter in it."""

import numpy as np
import pytest

from align.scan.mended_scan import load_scan
from scene.errors import AlignError


def load(tmp_path, vertices, faces, unit, **more):
    import trimesh

    path = tmp_path / "scan.ply"
    trimesh.Trimesh(vertices, faces, process=False).export(path)
    return load_scan(path, unit, **more)


def with_balls(mesh, *diameters, cut=-2.0):
    """The mesh and balls beside it, each without what lies below `cut` radii."""
    import trimesh

    sphere = trimesh.creation.icosphere(3)
    kept = sphere.faces[(sphere.vertices[sphere.faces][:, :, 2] > cut).all(1)]
    vertices, faces = [mesh.vertices], [mesh.faces]
    for number, diameter in enumerate(diameters):
        faces.append(kept + sum(map(len, vertices)))
        vertices.append(diameter / 2 * sphere.vertices + [150 + 100 * number, 0, 0])
    return np.concatenate(vertices), np.concatenate(faces)


def test_an_unknown_unit_keeps_the_file_s_numbers(tmp_path, coarse):
    mesh = load(tmp_path, 0.01 * coarse.vertices, coarse.faces, "unknown")
    assert mesh.radius_mm == pytest.approx(0.01 * coarse.radius_mm, rel=1e-6)
    assert any(repair.startswith("scan_unit is unknown") for repair in mesh.repairs)


@pytest.mark.parametrize(
    ("unit", "factor", "meant"), [("m", 1.0, '"mm"'), ("mm", 0.001, '"m"'), ("cm", 5.0, '"mm"'), ("mm", 1.0, None)]
)
def test_a_speck_and_a_house_are_doubted(tmp_path, coarse, unit, factor, meant):
    """Not refused: the registration sees the photographs, and knows better."""
    mesh = load(tmp_path, factor * coarse.vertices, coarse.faces, unit)
    doubts = [repair for repair in mesh.repairs if "right?" in repair]
    assert len(doubts) == (meant is not None)
    assert all(meant in doubt for doubt in doubts)


@pytest.mark.parametrize("cut", [-2.0, -0.6])
def test_a_ball_gives_the_scale_and_goes(tmp_path, coarse, cut):
    """Whole, or without the part that no scanner sees: a ball of 38 mm in a scan of unknown unit."""
    vertices, faces = with_balls(coarse, 38.0, cut=cut)
    mesh = load(tmp_path, vertices / 17, faces, "unknown", ball_diameter_mm=38.0)
    assert len(mesh.faces) == len(coarse.faces)
    assert mesh.radius_mm == pytest.approx(coarse.radius_mm, rel=1e-4)
    assert any("one unit of the file is 17 mm" in repair for repair in mesh.repairs)


def test_a_ball_under_a_known_unit_is_measured_only(tmp_path, coarse):
    mesh = load(tmp_path, *with_balls(coarse, 37.0), "mm", ball_diameter_mm=38.0)
    assert mesh.radius_mm == pytest.approx(coarse.radius_mm, rel=1e-6)
    assert any("measures 37 mm, 38 mm were said" in repair for repair in mesh.repairs)
    # Without a word of a ball it is part of the object.
    assert len(load(tmp_path, *with_balls(coarse, 37.0), "mm").faces) > len(mesh.faces)


@pytest.mark.parametrize(("balls", "found"), [((), "none"), ((38.0, 30.0), "38, 30")])
def test_no_ball_or_two_are_refused(tmp_path, coarse, balls, found):
    with pytest.raises(AlignError, match=f"scan_ball_diameter_mm expects one ball.*{found}"):
        load(tmp_path, *with_balls(coarse, *balls), "unknown", ball_diameter_mm=38.0)
