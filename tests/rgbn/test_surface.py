"""`rgbn solve --mesh`: whose surface is written, where it lies, and that nothing is solved twice for it."""

import json
import shlex
import sys

import cv2
import numpy as np
import pytest
import trimesh

WIDTH, HEIGHT, FOCAL = 96, 72, 150.0
BALL_MM, RADIUS_MM = np.array([0.0, 0.0, -300.0]), 50.0
FLASHES_MM = [[180 * np.cos(a), 180 * np.sin(a), 40 * np.sin(3 * a)] for a in np.arange(10) * 2 * np.pi / 10]


def ball():
    """Return mask, normals (H, W, 3) and places (H, W, 3) in mm of a ball as a pinhole camera sees it."""
    v, u = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    rays = np.stack([(u - (WIDTH - 1) / 2) / FOCAL, -(v - (HEIGHT - 1) / 2) / FOCAL, -np.ones_like(u)], -1)
    a, b = (rays**2).sum(-1), rays @ BALL_MM
    inside = b**2 - a * (BALL_MM @ BALL_MM - RADIUS_MM**2)
    mask = inside > 0.15 * inside.max()
    places = rays * ((b - np.sqrt(np.maximum(inside, 0))) / a)[..., None]
    return mask, (places - BALL_MM) / RADIUS_MM, places


def photograph(folder, *, near):
    """Write a session of a matte ball: under flashes near it, by a lights.json, or under distant lights, by a .lp."""
    folder.mkdir()
    mask, normals, places = ball()
    rows = []
    for i, flash in enumerate(np.array(FLASHES_MM)):
        to_flash = flash - places if near else np.broadcast_to(flash - BALL_MM, places.shape)
        distance = np.linalg.norm(to_flash, axis=-1, keepdims=True)
        shade = np.maximum((normals * to_flash / distance).sum(-1), 0) * (300 / distance[..., 0]) ** 2
        image = np.where(mask, 0.5 * shade, 0)
        cv2.imwrite(str(folder / f"f{i}.png"), np.round(image * 65535).astype(np.uint16))
        reach = np.linalg.norm(flash - BALL_MM)
        direction = ((flash - BALL_MM) / reach).tolist()
        rows.append({"name": f"f{i}", "direction": direction, "position_mm": flash.tolist() if near else None})
        rows[-1]["intensity"] = [(300 / reach) ** 2] * 3
        rows[-1] |= {"direction_sigma_deg": 0.1, "intensity_sigma": 0.01, "flags": []}
    model = {"model": "near" if near else "distant", "reference_point_mm": BALL_MM.tolist(), "ambient": None}
    (folder / "known.json").write_text(json.dumps({"frames": rows, **model}))
    cv2.imwrite(str(folder / "mask.png"), 255 * mask.astype(np.uint8))
    camera = f"width = {WIDTH}\nheight = {HEIGHT}\nfx = {FOCAL}\nfy = {FOCAL}\n"
    camera += f"cx = {(WIDTH - 1) / 2}\ncy = {(HEIGHT - 1) / 2}\n"
    (folder / "session.toml").write_text(
        f'[frames]\nflash = "f*.png"\nlinear = true\n[camera]\n{camera}'
        '[lights]\nfile = "known.json"\n[object]\nmask = "mask.png"\n'
    )
    return folder


@pytest.fixture
def solve(run_rgbn):
    """Run `rgbn solve`; return exit code and what was said."""

    def run(session, out, *words):
        code, _, said = run_rgbn("solve", session, "--out", out, *words)
        return code, said

    return run


@pytest.fixture(scope="module")
def near_session(tmp_path_factory):
    return photograph(tmp_path_factory.mktemp("near") / "session", near=True)


def radii(path):
    """Return each vertex' distance from the ball's true middle, mm."""
    mesh = trimesh.load_mesh(path)
    assert len(mesh.faces) > 1000
    return np.linalg.norm(mesh.vertices - BALL_MM, axis=1)


@pytest.mark.full
def test_the_mesh_is_the_ball_where_it_stood(near_session, solve, tmp_path):
    """The lights' reference point is the ball's middle, 50 mm behind what is seen: only the shading tells the depth."""
    mesh = tmp_path / "ball.ply"
    code, said = solve(near_session, tmp_path / "out", "--method", "ls,near", "--mesh", mesh)
    assert code == 0, said
    assert "near," in said
    assert "distance was found by the shading" in said
    assert np.median(np.abs(radii(mesh) - RADIUS_MM)) < 1.5
    depth = np.load(tmp_path / "out" / "depth" / "near.npy")
    vertices = trimesh.load_mesh(mesh).vertices
    assert np.isclose(vertices[:, 2].max(), np.nanmax(depth), atol=1e-3), "the depth map's own surface"


def test_without_depth_the_first_methods_normals_are_integrated(near_session, solve, tmp_path):
    mesh = tmp_path / "ball.ply"
    code, said = solve(near_session, tmp_path / "out", "--method", "iterative,ls", "--mesh", mesh)
    assert code == 0, said
    assert "iterative," in said
    assert "z = -300 mm" in said
    middle = np.median(trimesh.load_mesh(mesh).vertices[:, 2])
    assert abs(middle + 300) < 15


@pytest.mark.parametrize("name", ["ball.obj", "ball"])
def test_another_ending_is_refused_before_the_work(near_session, solve, tmp_path, name):
    code, said = solve(near_session, tmp_path / "out", "--mesh", tmp_path / name)
    assert code == 2
    assert "written as PLY" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.full
def test_another_program_runs_once_for_its_mesh(near_session, solve, tmp_path):
    """It counts its own calls, beside what it is told: a second solve would show."""
    np.save(tmp_path / "normals.npy", np.where(ball()[0][..., None], ball()[1], 0))
    (tmp_path / "count.py").write_text(
        "import json, sys\nfrom pathlib import Path\nimport cv2, numpy as np\n"
        "data, out, here = map(Path, sys.argv[1:])\n"
        "with open(here / 'calls.txt', 'a') as file:\n    file.write('called\\n')\n"
        "normals, mask = np.load(here / 'normals.npy'), cv2.imread(str(data / 'mask.png'), 0) > 0\n"
        "known = np.linalg.norm(normals, axis=-1) > 0.5\n"
        "whole = np.zeros((*mask.shape, 3))\nwhole[mask] = normals[known]\nnp.save(out / 'normals.npy', whole)\n"
    )
    program = f"{shlex.quote(sys.executable)} {tmp_path / 'count.py'} {{data}} {{out}} {tmp_path}"
    words = ("--method", "ls", "--external", f"Counting={program}")
    for mesh in ("first.ply", "second.ply"):
        code, said = solve(near_session, tmp_path / "out", *words, "--mesh", tmp_path / mesh)
        assert code == 0, said
        assert (tmp_path / mesh).exists()
    assert (tmp_path / "calls.txt").read_text().split() == ["called"]


def test_a_mesh_of_anothers_is_refused_before_the_work(near_session, solve, tmp_path):
    (tmp_path / "ball.ply").write_text("mine")
    code, said = solve(near_session, tmp_path / "out", "--mesh", tmp_path / "ball.ply")
    assert code == 2
    assert "rgbn did not write it" in said
    assert (tmp_path / "ball.ply").read_text() == "mine"
    assert not (tmp_path / "out" / "lights.json").exists(), "no step ran"
