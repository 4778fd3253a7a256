"""A table that was scanned along goes; the flat parts of real objects stay."""

import numpy as np
import pytest
import trimesh

from align.scan.beside_object import find_table
from align.scan.scan_surface import surface_of
from fixtures.mesh_shapes import over_grid

SPAN = np.linspace(-100, 100, 161)


def field(height, *, x=SPAN, y=SPAN):
    """What a scanner sees from above: a height (N, M) over a grid, steep walls and all, in one piece."""
    across, along = np.meshgrid(x, y, indexing="ij")
    mesh = over_grid(np.stack([across, along, height(across, along) + 0 * across], -1))
    return mesh.vertices, mesh.faces


def dome(height, radius, x=0.0, y=0.0):
    return lambda u, v: height * np.sqrt(np.clip(1 - ((u - x) ** 2 + (v - y) ** 2) / radius**2, 0, None))


def plinth(side):
    """A dome on a block: the grid's outermost rows are the block's sides."""
    return lambda u, v: np.where(np.maximum(abs(u), abs(v)) > 99, -side, dome(80, 40)(u, v))


def plate(u, v):
    return 0.5 * np.clip(np.hypot(u, v) - 60, 0, 35)


def box(size, *, open_below=False):
    mesh = trimesh.creation.box(size)
    for _ in range(4):
        mesh = mesh.subdivide()
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    return vertices, faces[~(vertices[faces][:, :, 2] < -size[2] / 2 + 1e-6).all(1)] if open_below else faces


def found(vertices, faces, rotation, noise_mm=0.05):
    generator = np.random.default_rng(0)
    moved = (vertices + noise_mm * generator.standard_normal(vertices.shape)) @ rotation.T + [300, -40, 900]
    return find_table(surface_of(moved, faces))


TABLES = {
    "dome": field(dome(35, 30)),
    "dome beside the middle": field(dome(35, 30, 50, 45)),
    "block": field(lambda u, v: 50.0 * ((abs(u) < 20) & (abs(v) < 30))),
    "small thing": field(dome(10, 9, 20, -30)),
    "two things": field(lambda u, v: dome(35, 30, 30, 30)(u, v) + dome(20, 20, -40, -30)(u, v)),
}


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("noise_mm", [0.0, 0.2])
def test_a_table_goes_and_nothing_else(rotations, name, noise_mm):
    vertices, faces = TABLES[name]
    for rotation in rotations[:2]:
        table, said = found(vertices, faces, rotation, noise_mm)
        height = vertices[faces][:, :, 2]
        # All of the table; of the object at most what lies within a few noises of the table.
        assert table[height.max(1) == 0].mean() > 0.999
        assert not table[height.max(1) > 2.2].any()
        assert said.startswith("dropped a table")


def test_a_table_smaller_than_a_wall_of_what_stands_on_it_goes(rotations):
    block = field(lambda u, v: 300.0 * (np.maximum(abs(u), abs(v)) < 60))
    table, said = found(*trimesh.remesh.subdivide_to_size(*block, 12.0), rotations[0])
    assert said.startswith("dropped a table")
    assert table.any()


def test_a_table_apart_from_the_object_goes_too(coarse, rotations):
    lifted = coarse.vertices - [0, 0, coarse.vertices[:, 2].min() - 2.0]
    top, squares = field(lambda u, v: 0 * u, x=1.5 * SPAN, y=1.5 * SPAN)
    vertices = np.concatenate([lifted, top])
    faces = np.concatenate([coarse.faces, squares + len(lifted)])
    table, _ = found(vertices, faces, rotations[0])
    assert (table == (np.arange(len(faces)) >= len(coarse.faces))).all()


OBJECTS = {
    "brick": box((200, 90, 60)),
    "brick without its underside": box((200, 90, 60), open_below=True),
    "tile without its underside": box((200, 150, 10), open_below=True),
    "relief on its ground": field(
        lambda u, v: 6 * np.clip(1 - (u**2 + v**2) / 80**2, 0, 1) * (1 + 0.3 * np.sin(u / 9))
    ),
    "coin": field(lambda u, v: 1.5 * (np.hypot(u, v) < 80) * (1 + np.sin(u / 9))),
    "plate": field(plate),
    "statue on a plinth": field(plinth(12.0)),
    "statue on a thin plinth": field(plinth(4.0)),
    "bracket": field(lambda u, v: 60.0 * (abs(u) < 5), y=SPAN / 2),
    "flat board": field(lambda u, v: 0 * u),
    "step": field(lambda u, v: 40.0 * (u > 20)),
    "table cut off beside the thing": field(dome(35, 30, 85, 40)),
}
DOUBTFUL = {"relief on its ground", "bracket", "plate", "table cut off beside the thing"}


@pytest.mark.parametrize("name", OBJECTS)
def test_flat_parts_of_an_object_stay(rotations, name):
    for rotation in rotations[:2]:
        table, said = found(*OBJECTS[name], rotation)
        assert not table.any()
        # What looks like a table in all but one respect is named, so that nobody wonders.
        assert ("Cut it off if it is a table" in said) == (name in DOUBTFUL)
