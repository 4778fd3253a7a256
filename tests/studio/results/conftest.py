"""An output folder whose every pixel is known: normals, colours and lights of the test's own, solved by the solvers."""

from types import SimpleNamespace

import numpy as np
import pytest

from fixtures.random_lights import random_lights
from scene.camera import Camera
from scene.estimate import Estimate
from scene.frames import Frames
from scene.normals import unit
from scene.output_folder import open_record
from scene.store import Store
from solve.solve import solve
from studio.results.result_maps import Results
from studio.review.folder import Review

SIZE = WIDTH, HEIGHT = 53, 37
CAMERA = Camera(WIDTH, HEIGHT, 90.0, 90.0, 24.0, 19.5)
REFERENCE = np.array([5.0, -4.0, -300.0])
ODD = (31, 12)
"""A pixel (u, v) unlike all others."""
CLIPPED_FRAME, SHADOW_FRAME = 3, 6


def lights_of(count=10, *, near=True):
    room = ([-160, -160, 180], [160, 160, 260])
    return random_lights(10_061, REFERENCE, *room, count=count, strengths=(0.6, 1.4), near=near).normalised()


def render(lights, normals, albedo, generator, noise):
    """Return (F, H, W, 3): albedo times the light vectors' dot products, with noise."""
    points = CAMERA.points_at_depth(CAMERA.grid().reshape(-1, 2), REFERENCE[2])
    vectors = lights.at(points).reshape(len(lights), HEIGHT, WIDTH, 3, 3)
    linear = albedo * np.maximum(np.einsum("fhwcx,hwx->fhwc", vectors, np.nan_to_num(normals)), 0)
    return linear + generator.normal(0, noise, linear.shape)


@pytest.fixture
def make(tmp_path):
    """Return what writes such a folder: (near, noise, methods, shown_lights) to it and its truth."""

    def made(*, near=True, noise=0.002, methods=("ls", "iterative"), shot_with=None):
        generator = np.random.default_rng(10_062)
        lights, store = lights_of(near=near), Store(tmp_path / "out")
        with open_record(store.folder) as record:
            for step in ("check", "calibrate", "align", "solve", "twin"):
                with record.making(step, "by the test") as entry:
                    entry |= {"warnings": [], "result": {}}
        u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
        mask = (np.abs(u - 26) < 20) & (np.abs(v - 17) < 15)
        normals = unit(np.stack([(u - 26) / 50 + 0.05 * np.sin(v), (15 - v) / 40, np.ones_like(u) * 1.0], -1))
        albedo = generator.uniform(0.15, 0.35, (HEIGHT, WIDTH, 3))
        normals[ODD[1], ODD[0]], albedo[ODD[1], ODD[0]] = unit(np.array([-0.35, 0.3, 1.0])), (0.1, 0.5, 0.25)
        normals[~mask] = np.nan
        linear = render(shot_with or lights, normals, albedo, generator, noise)
        linear[CLIPPED_FRAME, ODD[1], ODD[0]] = (0.2, 1.01, 0.2)
        linear[SHADOW_FRAME, ODD[1], ODD[0]] = 0.0
        twin = 0.9 * render(shot_with or lights, normals, albedo, generator, noise)
        frames = Frames.from_linear(lights.names, linear)
        store.save_frames(frames)
        store.save_camera(CAMERA)
        store.save_lights(lights)
        store.save_mask(mask)
        truth = unit(normals + [0.02, -0.01, 0.0])
        store.save_truth(truth, np.where(mask, 0.5, np.nan))
        rendered, found = Store(store.path("twin")), {}
        rendered.save_frames(Frames.from_linear(lights.names, twin))
        for method in methods:
            found[method] = solve(method, frames, lights, CAMERA, mask)
            store.save_estimate(found[method])
        estimate = solve("ls", rendered.load_frames(), lights, CAMERA, mask)
        rendered.save_estimate(estimate)
        return SimpleNamespace(store=store, folder=store.folder, lights=lights, mask=mask, truth=truth, linear=linear,
                               twin=twin, frames=frames, found=found, twin_found=estimate,
                               camera=CAMERA, odd=ODD, clipped=CLIPPED_FRAME, shadowed=SHADOW_FRAME,
                               read=read)  # fmt: skip

    return made


@pytest.fixture
def made(make):
    return make()


@pytest.fixture
def flat(tmp_path):
    """Return a folder of one flat wall whose normals are odd at the pixels that are named, and nowhere else."""

    def wall(odd):
        store, ones = Store(tmp_path / "wall"), np.ones((HEIGHT, WIDTH))
        normals = np.zeros((HEIGHT, WIDTH, 3), np.float32)
        normals[..., 2] = 1
        for u, v in odd:
            normals[v, u] = (1, 0, 0)
        albedo = np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)
        for folder in (store, Store(store.path("twin"))):
            folder.save_estimate(Estimate("ls", normals, albedo, ones.astype(np.uint16)))
        mask = np.zeros((HEIGHT, WIDTH), bool)
        mask[4:30, 9:50] = True
        store.save_mask(mask)
        return read(store.folder)

    return wall


def read(folder):
    return Results(Review.read(folder))
