"""A scene rendered to frames, one for each light, by the engine that it asks for; killed and run again, it goes on."""

import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.current import code_fingerprint, fingerprint
from scene.files import write_npy
from scene.frames import PEDESTAL, Frames, encode
from scene.output_folder import scratch_for
from scene.store import Store
from twin.description.description import Sampling, TwinScene
from twin.engines.engine_choice import Choice, choose_engine
from twin.engines.film import Film
from twin.engines.light_layers import TRIED, Piece, PieceRenderer, noise_of_one_sample, pieces_of, standing_light
from twin.engines.unfinished import Unfinished
from twin.engines.variant import SLOW, graphics_card, pick_variant
from twin.ground_truth import ground_truth

FEWEST, MOST = 4, 1024
"""Samples a pixel, unless others are asked for."""
SAMPLES_PER_FRAME = 1 << 24
"""Samples that a frame by stock Mitsuba may cost, unless more are asked for."""

LAYERS = ("direct", "indirect")


@dataclass(frozen=True)
class Rendering:
    """The twin's frames, and how they were made.

    frames: Named and ordered as the lights; no ambient, no noise but the sampling's. Black where the object is not.
    choice: The engine, and why.
    variant: Mitsuba's.
    seconds: Wall time of this run.
    standing (H, W, 3): Light that is in every frame: what is seen without flash. None: there is none.
    pieces, found: Frames, or bands of all frames; and how many of them a run that was stopped had left.
    """

    frames: Frames
    choice: Choice
    variant: str
    sampling: Sampling
    seconds: float
    pieces: int
    found: int = 0
    warnings: tuple[str, ...] = ()
    standing: NDArray[np.float32] | None = None

    def facts(self) -> dict[str, Any]:
        """Return what the summary says of it."""
        choice = self.choice
        return {
            "engine": choice.engine,
            "reason": choice.reason,
            "error": self.sampling.error,
            "samples_per_pixel": choice.samples,
            "variant": self.variant,
            "max_depth": self.sampling.max_depth,
            "noise": choice.noise,
            "seconds": self.seconds,
            "warnings": self.warnings,
        }


@dataclass(frozen=True)
class _Work:
    """What is to be rendered: all that another process needs to know."""

    scene: TwinScene
    film: Film
    choice: Choice
    apart: bool
    standing: NDArray[np.float32] | None


def render_scene(
    scene: TwinScene,
    *,
    apart: bool = False,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    tell: Callable[[str], None] | None = None,
    store: Store | None = None,
    scratch: Path | None = None,
) -> Rendering:
    """Render a scene, one frame for each light.

    Parameters
    ----------
    scene : TwinScene
        With `sampling.engine` "auto": see `twin.engines.engine_choice`.
    apart : bool
        With a store, also keep light that met one surface, and light that met more, each by itself.
    executor : Executor or None
        Renders shares of the frames elsewhere, on a cluster say. Mitsuba uses all cores of a machine by itself.
    progress : callable or None
        Called with (pieces done, pieces in all): frames, or bands of all frames.
    tell : callable or None
        Called with the line that says which engine renders, and why.
    store : Store or None
        Frames go to its `frames/codes.npy`, memory-mapped, and the true maps beside: `truth_normals.npy` and so on, see
        `twin.ground_truth`; with `apart` also `truth_direct.npy` and `truth_indirect.npy`, (F, H, W, 3) float16, and
        `truth_standing.npy`, (H, W, 3) float32, where there is an environment. Without a store: see `scratch`.
        Until it is done a rendering lies in `scene.output_folder.scratch_for` the store: of a run that was killed, the
        same rendering keeps what is there, and does only what lacks.
    scratch : Path or None
        Folder for a rendering without a store, memory-mapped; the caller removes it. None: memory.

    Raises
    ------
    RenderError
        The camera sees nothing.
    """
    started = time.perf_counter()
    film, folder = scene.film(), scratch if store is None else scratch_for(store.folder)
    choice = _elsewhere(executor, _choose, scene, film)
    give_memory_back()
    if tell is not None:
        tell(str(choice))
        if graphics_card():
            tell("renderer: {}, {}".format(*pick_variant()))
    standing = _elsewhere(executor, standing_light, scene, film)
    work = _Work(scene, film, choice, apart and store is not None, standing)
    shape = (len(scene.lights), scene.camera.height, scene.camera.width, 3)
    layers = dict.fromkeys(LAYERS if work.apart else (), (shape, np.float16, 0))
    mark = "" if folder is None else rendering_mark(scene, apart)
    kept = Unfinished({"codes": (shape, np.uint16, PEDESTAL), **layers}, folder, mark)
    pieces, found = pieces_of(film, len(scene.lights), choice.engine), len(kept.done)
    if progress is not None and found:
        progress(found, len(pieces))
    for index, parts in _made(work, pieces, sorted(set(range(len(pieces))) - kept.done), executor):
        piece, first = pieces[index], film.rows.start
        rows = slice(first + piece.rows.start, first + piece.rows.stop)
        for name, values in parts.items():
            kept.arrays[name][piece.frames, rows, film.columns] = values
        kept.finished(index)
        if progress is not None:
            progress(len(kept.done), len(pieces))
    give_memory_back()
    if store is None:
        frames = Frames(scene.lights.names, kept.arrays["codes"], np.ones(len(scene.lights)))
    else:
        frames = _stored(store, kept, work)
        ground_truth(scene, folder=store.folder)
    seconds = time.perf_counter() - started
    variant, warnings = pick_variant()[0], _warnings(film, choice)
    still = None if standing is None else film.whole(standing)
    return Rendering(frames, choice, variant, scene.sampling, seconds, len(pieces), found, warnings, still)


def rendering_mark(scene: TwinScene, apart: bool) -> str:
    """Return what tells a rendering from any other: the scene, the code and the libraries."""
    return fingerprint(scene, apart, code=code_fingerprint("twin"))


def _elsewhere(executor: Executor | None, work: Callable[..., Any], *arguments: Any) -> Any:
    return work(*arguments) if executor is None else executor.submit(work, *arguments).result()


def _choose(scene: TwinScene, film: Film) -> Choice:
    engine, reason = choose_engine(scene)

    def rendered(samples: float) -> int:
        # Stock Mitsuba samples each pixel on a jittered grid.
        return math.ceil(math.sqrt(samples)) ** 2 if engine == "mitsuba" else math.ceil(samples)

    if scene.sampling.samples is not None:
        samples = rendered(scene.sampling.samples)
        # Well spread samples leave less noise than their number says: fewer are tried as they are.
        one = noise_of_one_sample(scene, film, engine, min(samples, TRIED))
    else:
        one, most = noise_of_one_sample(scene, film, engine), MOST
        if engine == "mitsuba":
            most = max(FEWEST, min(most, SAMPLES_PER_FRAME // (film.window[2] * film.window[3])))
        samples = rendered(float(np.clip((one / scene.sampling.error) ** 2, FEWEST, most)))
    return Choice(engine, samples, reason, one / math.sqrt(samples))


def give_memory_back() -> None:
    """Return to the system what Dr.Jit keeps of freed arrays: it would keep the most that it ever needed."""
    import drjit

    drjit.flush_malloc_cache()


def _warnings(film: Film, choice: Choice) -> tuple[str, ...]:
    warnings, (variant, note) = [], pick_variant()
    if variant == SLOW:
        warnings.append(f"The twin was rendered by Mitsuba's slow variant: {note}")
    if film.pixels is not None and choice.engine == "mitsuba":
        warnings.append(
            "The twin was rendered without lens distortion and with square pixels, then resampled (bilinear): it is "
            "slightly softer than a photograph."
        )
    if choice.noise is not None and choice.noise > 0.03:
        warnings.append(
            f"The twin's own noise is {100 * choice.noise:.0f} % of a lit pixel at {choice.samples} samples a pixel; "
            "it counts as an error of the methods that are run on it."
        )
    return tuple(warnings)


def _made(
    work: _Work, pieces: list[Piece], todo: list[int], executor: Executor | None
) -> Iterator[tuple[int, dict[str, NDArray]]]:
    """Yield (index, arrays of the film's box) of every piece, as they are done."""
    if executor is None:
        yield from _make(work, pieces, todo)
        return
    # A share costs its worker one scene; more shares than a machine's cores only build more scenes.
    shares = [todo[start::16] for start in range(min(len(todo), 16))]
    futures = [executor.submit(_list, work, pieces, share) for share in shares]
    for future in as_completed(futures):
        yield from future.result()


def _list(work: _Work, pieces: list[Piece], share: list[int]) -> list[tuple[int, dict[str, NDArray]]]:
    return list(_make(work, pieces, share))


def _make(work: _Work, pieces: list[Piece], share: list[int]) -> Iterator[tuple[int, dict[str, NDArray]]]:
    """Render some of the pieces in this process. Idempotent: the samples are seeded by the piece's place."""
    if not share:
        return
    renderer = PieceRenderer(work.scene, work.film, work.choice.engine, apart=work.apart)
    for index in share:
        layers, standing = renderer.render(pieces[index], work.choice.samples), work.standing
        layers = replace(layers, standing=None if standing is None else standing[pieces[index].rows])
        parts: dict[str, NDArray] = {"codes": encode(layers.frames())}
        if work.apart:
            onward = np.zeros_like(layers.direct) if layers.onward is None else layers.onward
            parts |= {"direct": layers.direct, "indirect": onward}
        yield index, parts


def _stored(store: Store, kept: Unfinished, work: _Work) -> Frames:
    """Move a finished rendering to its store."""
    codes, names = kept.arrays["codes"], [name for name in kept.arrays if name != "codes"]
    kept.hand_over({"codes": store.path("frames", "codes.npy"), **{n: store.path(f"truth_{n}.npy") for n in names}})
    if work.apart and work.standing is not None:
        write_npy(store.path("truth_standing.npy"), work.film.whole(work.standing))
    store.save_frames_header(Frames(work.scene.lights.names, codes, np.ones(len(codes))))
    return store.load_frames()
