"""`rgbn export --format mitsuba` of a scene description."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

COMMAND = [str(Path(sys.executable).parent / "rgbn")]
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


def export(source, out, *words):
    command = [*COMMAND, "export", str(source), "--out", str(out), "--format", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.render
def test_a_scene_description_goes_out_whole(tmp_path):
    np.save(tmp_path / "a.npy", np.full((2, 2, 3), 0.5))
    (tmp_path / "box.toml").write_text(SCENE)
    run = export(tmp_path / "box.toml", tmp_path / "out", "mitsuba")
    assert run.returncode == 0, run.stderr
    folder = tmp_path / "out" / "export"
    assert run.stdout.strip() == str(folder / "scene.xml")
    assert "3 lights, one at a time" in run.stderr
    assert "-D light=ring_000" in run.stderr
    found = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    lights = [f"lights/ring_00{i}.xml" for i in range(3)]
    assert found == [*lights, "meshes/00.ply", "scene.xml", "textures/00.exr"]


def test_what_cannot_be_exported_is_refused(tmp_path):
    (tmp_path / "box.toml").write_text(SCENE.replace("fx", "focal"))
    for source, form, message in (
        (tmp_path / "box.toml", "mitsuba", "camera.focal: unknown key"),
        (tmp_path / "no.toml", "mitsuba", "not found"),
        (tmp_path / "box.toml", "mat", "no session"),
    ):
        run = export(source, tmp_path / "out", form)
        assert run.returncode == 2, run.stderr
        assert "Traceback" not in run.stderr
        if form == "mitsuba":
            assert message in run.stderr
        assert not (tmp_path / "out" / "export").exists()
