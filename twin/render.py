"""The twin: a scene, or the registered scan under the calibrated lights, before the session's camera.

What is physical of a scan: its shape with its cast shadows, near or distant lights, the measured albedo, light that
goes from one part of the object to another. What is not (yet): gloss, the table and whatever else stands around, noise,
lens blur. A scene description may have the first two.
"""

import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.files import create_array
from scene.frames import PEDESTAL, Frames, encode
from scene.lights import Lights
from scene.mesh import Mesh
from scene.pose import Pose
from scene.store import Store
from twin.description import Sampling, TwinScene
from twin.film import Film
from twin.ground_truth import ground_truth, save_ground_truth
from twin.path_tracing import PathTracer
from twin.scan_scene import scan_scene
from twin.variant import pick_variant

SAMPLES_PER_FRAME = 1 << 24
"""Samples that a frame may cost unless more are asked for: seconds on two cores."""


@dataclass(frozen=True)
class Rendering:
    """The twin's frames, and how they were made.

    Parameters
    ----------
    frames : Frames
        Named and ordered as the lights; no ambient, no noise but the sampling's. Black where the object is not.
    variant : str
        Mitsuba's.
    samples_per_pixel, max_depth : int
    noise : float
        Of the sampling: standard deviation of a lit pixel over its mean, measured by rendering a strip twice.
    seconds : float
        Wall time.
    warnings : tuple of str
    """

    frames: Frames
    variant: str
    samples_per_pixel: int
    max_depth: int
    noise: float
    seconds: float
    warnings: tuple[str, ...] = ()


def render(
    mesh: Mesh,
    pose: Pose,
    camera: Camera,
    lights: Lights,
    albedo: NDArray[np.float32],
    *,
    albedo_depth_mm: float | None = None,
    white_value: NDArray[np.float64] | None = None,
    samples_per_pixel: int | None = None,
    max_depth: int = 3,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    store: Store | None = None,
) -> Rendering:
    """Render the scan with its measured albedo, one frame for each light.

    Parameters
    ----------
    mesh : Mesh
        The scan, millimetres, in its own frame.
    pose : Pose
        camera_from_scan.
    camera : Camera
        Perspective or orthographic; distortion and unequal fx and fy by resampling.
    lights : Lights
        Near lights are rendered as points at `positions_mm`, others as distant.
    albedo : (H, W, 3) float32
        Pixel value under a light of intensity 1 along the normal, NaN where unknown: what a solver measured.
    albedo_depth_mm : float or None
        The z at which near lights were evaluated when the albedo was measured, if not at the surface itself: a solver
        that knows no shape takes the reference point's.
    white_value : (3,) float64 or None
        Pixel value of the white ball under a light of intensity 1; `lights.white_value` if not given. The ball is
        taken to reflect 80 %: that alone decides how strong the interreflections are, never the direct light.
    samples_per_pixel : int or None
        None: 64, or fewer for an object that fills more than a quarter of a megapixel, down to 4. Rounded up to a
        square: each pixel is sampled on a jittered grid.
    max_depth : int
        2: direct light only; 3: one interreflection; and so on.
    executor : Executor or None
        Renders shares of the frames elsewhere, on a cluster say. Mitsuba uses all cores of a machine by itself.
    progress : callable or None
        Called with (frames done, frames in all).
    store : Store or None
        Frames go to its `frames/codes.npy`, memory-mapped, and the true maps beside: `truth_normals.npy` and so on, see
        `twin.ground_truth`. Without it frames stay in memory.

    Raises
    ------
    RenderError
        The mesh is empty or not finite, the camera does not see it, a light lies inside it, the albedo has another
        size than the camera's, or a light or the albedo holds nothing that can be rendered.

    Notes
    -----
    With reflectance rho = albedo / white * 0.8 and irradiance E = pi * intensity * white / 0.8, a Lambertian surface
    has the radiance rho / pi * E * cos = albedo * intensity * cos: the direct light's pixel values are the session's
    own, whatever the ball's true reflectance.
    """
    scene, warnings = scan_scene(
        mesh,
        pose,
        camera,
        lights,
        albedo,
        albedo_depth_mm=albedo_depth_mm,
        white_value=white_value,
        sampling=Sampling("mitsuba", samples_per_pixel, max_depth),
    )
    rendered = render_scene(scene, executor=executor, progress=progress, store=store)
    return replace(rendered, warnings=(*warnings, *rendered.warnings))


def render_scene(
    scene: TwinScene,
    *,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    store: Store | None = None,
) -> Rendering:
    """Render any scene by stock Mitsuba, one frame for each light.

    Parameters
    ----------
    scene : TwinScene
        Its `sampling.samples` and `max_depth` hold, whatever its engine.
    executor, progress, store
        See `render`.

    Raises
    ------
    RenderError
        The camera sees nothing.
    """
    started = time.perf_counter()
    lights, camera, samples_per_pixel = scene.lights, scene.camera, scene.sampling.samples
    film = scene.film()
    variant, note = pick_variant()
    warnings = []
    if variant == "scalar_rgb":
        warnings.append(f"The twin was rendered by Mitsuba's slow variant: {note}")
    if film.pixels is not None:
        warnings.append(
            "The twin was rendered without lens distortion and with square pixels, then resampled (bilinear): it is "
            "slightly softer than a photograph."
        )
    if samples_per_pixel is None:
        affordable = SAMPLES_PER_FRAME // (film.window[2] * film.window[3])
        samples_per_pixel = int(np.clip(math.isqrt(affordable), 2, 8)) ** 2
    samples_per_pixel = math.ceil(math.sqrt(samples_per_pixel)) ** 2
    settings = (scene, film, samples_per_pixel)
    noise = _noise(settings) if executor is None else executor.submit(_noise, settings).result()
    if noise > 0.03:
        warnings.append(
            f"The twin's own noise is {100 * noise:.0f} % of a lit pixel at {samples_per_pixel} samples a pixel; it "
            "counts as an error of the methods that are run on it."
        )
    with _codes(store, (len(lights), camera.height, camera.width, 3)) as codes:
        for done, (index, image) in enumerate(_images(settings, executor), 1):
            codes[index, film.rows, film.columns] = image
            if progress is not None:
                progress(done, len(lights))
    frames = Frames(lights.names, codes, np.ones(len(lights)))
    if store is not None:
        store.save_frames_header(frames)
        frames = store.load_frames()
        save_ground_truth(ground_truth(scene), store.folder)
    seconds = time.perf_counter() - started
    depth = scene.sampling.max_depth
    return Rendering(frames, variant, samples_per_pixel, depth, noise, seconds, tuple(warnings))


_Settings = tuple[TwinScene, Film, int]


def _images(settings: _Settings, executor: Executor | None) -> Iterator[tuple[int, NDArray[np.uint16]]]:
    """Yield (index, codes of the film's box) of every light, as they are done."""
    count = len(settings[0].lights)
    if executor is None:
        yield from _render_share(settings, range(count))
        return
    # A share costs its worker one scene; more shares than a machine's cores only build more scenes.
    shares = [range(count)[start :: min(count, 16)] for start in range(min(count, 16))]
    futures = [executor.submit(_list_share, settings, share) for share in shares]
    for future in as_completed(futures):
        yield from future.result()


def _list_share(settings: _Settings, indices: range) -> list[tuple[int, NDArray[np.uint16]]]:
    return list(_render_share(settings, indices))


def _render_share(settings: _Settings, indices: range) -> Iterator[tuple[int, NDArray[np.uint16]]]:
    """Render some of the lights in this process. Idempotent: the samples are seeded by the light's index."""
    scene, film, samples_per_pixel = settings
    variant, _ = pick_variant()
    tracer = PathTracer(scene, film, variant=variant)
    for index in indices:
        yield index, encode(film.place(tracer.image(index, samples_per_pixel)))


def _noise(settings: _Settings) -> float:
    """Render the film's middle rows twice under the strongest light; see `Rendering.noise`."""
    scene, film, samples_per_pixel = settings
    top, left, height, width = film.window
    strip = replace(film, window=(top + max(0, height // 2 - 24), left, min(48, height), width))
    variant, _ = pick_variant()
    tracer = PathTracer(scene, strip, variant=variant)
    index = int(np.argmax(scene.irradiance.sum(1)))
    one, two = (tracer.image(index, samples_per_pixel, seed=seed) for seed in (1, 2))
    mean = (one + two) / 2
    lit = mean > 0.05 * mean.max()
    # Two renderings differ by twice the variance of one.
    return float(np.sqrt(np.mean((one - two)[lit] ** 2) / 2) / np.mean(mean[lit])) if lit.any() else 0.0


@contextmanager
def _codes(store: Store | None, shape: tuple[int, ...]) -> Iterator[NDArray[np.uint16]]:
    """Give an array of black frames: in memory, or in the store, where it appears when all frames are done."""
    if store is None:
        yield np.full(shape, PEDESTAL, np.uint16)
        return
    with create_array(store.path("frames", "codes.npy"), shape, np.uint16) as codes:
        for frame in codes:
            frame[:] = PEDESTAL
        yield codes
