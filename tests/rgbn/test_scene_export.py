"""`rgbn export --format mitsuba` of a scene description."""

import numpy as np
import pytest

SCENE = """
[camera]
width = 32
height = 24
fx = 60.0
[[objects]]
shape = "cube"
scale = 30
translate_mm = [0, 0, -300]
material = "m"
[materials.m]
kind = "rough_plastic"
reflectance = { file = "a.npy" }
[[lights]]
kind = "ring"
count = 3
polar_deg = 40
"""


@pytest.fixture
def export(run_rgbn):
    """Run `rgbn export`; return exit code, what was printed, what was said."""
    return lambda source, out, form: run_rgbn("export", source, "--out", out, "--format", form)


@pytest.mark.render
def test_a_scene_description_goes_out_whole(export, tmp_path):
    np.save(tmp_path / "a.npy", np.full((2, 2, 3), 0.5))
    (tmp_path / "box.toml").write_text(SCENE)
    code, out, said = export(tmp_path / "box.toml", tmp_path / "out", "mitsuba")
    assert code == 0, said
    folder = tmp_path / "out" / "export"
    assert out.strip() == str(folder / "scene.xml")
    assert "3 lights, one at a time" in said
    assert "-D light=ring_000" in said
    found = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    lights = [f"lights/ring_00{i}.xml" for i in range(3)]
    assert found == [*lights, "meshes/00.ply", "scene.xml", "textures/00.exr"]


def test_what_cannot_be_exported_is_refused(export, tmp_path):
    (tmp_path / "box.toml").write_text(SCENE.replace("fx", "focal"))
    for source, form, message in (
        (tmp_path / "box.toml", "mitsuba", "camera.focal: unknown key"),
        (tmp_path / "no.toml", "mitsuba", "not found"),
        (tmp_path / "box.toml", "dome", "no session"),
    ):
        code, _, said = export(source, tmp_path / "out", form)
        assert code == 2, said
        assert "Traceback" not in said
        if form == "mitsuba":
            assert message in said
        assert not (tmp_path / "out" / "export").exists()
