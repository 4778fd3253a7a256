"""Photographs decoded by rgbn, and by LibRaw's own linear interpolation, on the same files in one run."""

import os
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from benchmarks.harness import Figures, Table, markdown
from scene.clock import now, since

ROUNDS = 3
BASIS = "LibRaw, into memory"
SIZES = {"small": (600, 2), "gates": (3000, 4), "full": (6000, 12)}
"""Width in pixels, two thirds as high, and number of the photographs: DNG of 14 bits, not compressed."""


@dataclass(frozen=True)
class DecodeRow:
    """One way through all photographs; seconds are the least of some rounds."""

    way: str
    frames: int
    megapixels: float
    processor_s: float
    wall_s: float


def _write(folder: Path, width: int, count: int) -> None:
    """Write flash frames of smooth light, texture and noise, and session.toml."""
    from twin.camera.virtual_camera import Sensor, write_dng

    rng = np.random.default_rng(0)
    v, u = np.mgrid[: width * 2 // 3, :width].astype(np.float32) / width
    texture = rng.integers(-300, 300, u.shape, dtype=np.int16)
    for index, angle in enumerate(np.linspace(0, 2 * np.pi, count, endpoint=False)):
        light = 4000 + 2000 * (np.cos(angle) * (u - 0.5) + np.sin(angle) * (v - 0.3))
        shot = {"exposure_s": 0.01, "iso": 100, "aperture": 8.0, "focal_mm": 50.0}
        time = datetime(2026, 1, 1) + timedelta(seconds=index)
        write_dng(folder / f"flash_{index:03d}.dng", (light + texture).astype(np.uint16), Sensor(), **shot, time=time)
    (folder / "session.toml").write_text('[frames]\nflash = "flash_*.dng"\n')


def _libraw(path: Path) -> None:
    import rawpy

    with rawpy.imread(str(path)) as raw:
        raw.postprocess(
            demosaic_algorithm=rawpy.DemosaicAlgorithm.LINEAR, user_wb=[1.0, 1.0, 1.0, 1.0], gamma=(1, 1),
            output_bps=16, output_color=rawpy.ColorSpace.raw, no_auto_bright=True, adjust_maximum_thr=0, user_flip=0,
        )  # fmt: skip


def _measured(width: int, count: int) -> list[DecodeRow]:
    from capture.photographs.decode import decode
    from capture.photographs.raw import read_raw
    from capture.session.session import load_session
    from scene.store import Store

    with tempfile.TemporaryDirectory() as place, ThreadPoolExecutor(os.cpu_count()) as pool:
        folder = Path(place)
        _write(folder, width, count)
        session = load_session(folder)

        def into_store() -> None:
            with tempfile.TemporaryDirectory() as out:
                decode(session, Store(Path(out)))

        ways: dict[str, Callable[[], object]] = {
            BASIS: lambda: list(pool.map(_libraw, session.flash)),
            "rgbn, into memory": lambda: list(pool.map(read_raw, session.flash)),
            "rgbn, superpixels": lambda: list(pool.map(lambda path: read_raw(path, half=True), session.flash)),
            "rgbn, audited, into the output folder": into_store,
        }
        return [DecodeRow(way, count, width * (width * 2 // 3) / 1e6, *_least(work)) for way, work in ways.items()]


def _least(work: Callable[[], object]) -> tuple[float, float]:
    """Return the least processor and the least wall seconds."""
    spent = []
    for _ in range(ROUNDS):
        start = now()
        work()
        taken = since(start)
        spent.append((taken["processor_seconds"], taken["seconds"]))
    return tuple(np.min(spent, axis=0).tolist())


def _shown(rows: Sequence[DecodeRow]) -> str:
    columns = {f"{rows[0].frames} RAW files of {rows[0].megapixels:.3g} megapixels": "{way}"}
    return markdown({**columns, "processor, s": "{processor_s:.2f}", "wall, s": "{wall_s:.2f}"}, rows)


def _figures(rows: Sequence[DecodeRow]) -> Figures:
    return {f"{row.way}: processor to LibRaw": row.processor_s / rows[0].processor_s for row in rows[1:]}


TABLES = (
    Table(
        "robustness", "decode", ("capture.photographs.decode", "capture.photographs.raw"), DecodeRow,
        lambda scale: [SIZES[scale]], _measured, _shown, _figures, is_timed=True,
    ),
)  # fmt: skip
