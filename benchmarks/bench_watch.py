"""What `rgbn watch` takes: seconds from a photograph's last byte to its verdict, photographs lost by kills, idle CPU.

    python -m benchmarks.bench_watch [verdict] [kills] [idle]

Without words: all three. Writes docs/evidence/watch.md. The verdict is timed in this process, on frames of 24
megapixels that `benchmarks.memory_session` makes, with processor seconds beside those of the wall: where a machine is
shared, these are the machine's.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

PAGE = ROOT / "docs" / "evidence" / "watch.md"
WIDTH, FLASHES, DIAMETERS = 6000, 60, {"chrome": (84.0,), "white": (76.0,)}
IDLE_S, FILES = 60.0, 60
WORK = Path(tempfile.gettempdir()) / "rgbn-bench-watch"


def verdicts() -> list[str]:
    """Time each photograph of a shoot of 24 megapixels, one after the other, as `watch` treats them."""
    from benchmarks.memory_session import write_session
    from capture.hot_folder.tracker import STILL_S
    from capture.photographs.kept import Kept
    from lab.init.answers import Answers, Asking
    from lab.watch.shoot import Shoot
    from lab.watch.shots import read_shot
    from scene.current import file_digest

    raw = WORK / "session" / "raw"
    if not raw.is_dir():
        write_session(WORK / "session", width=WIDTH, flashes=FLASHES, faces=20_000)
    shoot = Shoot(raw, Asking(Answers(DIAMETERS), silent=True))
    rows = []
    with tempfile.TemporaryDirectory() as kept:
        for path in sorted(raw.glob("*.dng")):
            marks = [(time.perf_counter(), time.process_time())]

            def mark(marks: list[tuple[float, float]] = marks) -> None:
                marks.append((time.perf_counter(), time.process_time()))

            shot = read_shot(path, str(file_digest(path)), Kept(Path(kept), "linear", half=False))
            shoot.add([shot], time.monotonic())
            mark()
            looked = shoot.lights_so_far.is_due(len(shoot.sorted.flash))
            for _ in shoot.follow():
                pass
            mark()
            shoot.look_at_object()
            mark()
            rows.append((looked, np.diff(marks, axis=0)))
            print(path.name, looked, np.round(rows[-1][1], 2).tolist(), flush=True)
    usual = np.array([spent for looked, spent in rows[-FLASHES // 2 :] if not looked])
    balls = np.array([spent[1] for looked, spent in rows if looked])
    glance, rest, normals = np.median(usual, axis=0)
    whole = usual[:, :2].sum(1)
    return [
        f"| 24 megapixels (6000 x 4000, DNG of 48 MB), frames {FLASHES // 2 + 1} to {FLASHES} of a shoot, median "
        "| wall, s | processor, s |",
        "|---|---|---|",
        f"| file stands still | {STILL_S:g} | 0 |",
        f"| decode, keep, flash fired, clipping, exposure, duplicates: the first verdict | {_two(glance)} |",
        f"| light's place with its sigma, focus, movement | {_two(rest)} |",
        f"| **last byte to whole verdict** | {_two(np.median(whole, axis=0) + [STILL_S, 0])} |",
        f"| the slowest of them: all lights fitted together again | {_two(whole.max(0) + [STILL_S, 0])} |",
        f"| after it: the object's sigma map, the next flash | {_two(normals)} |",
        f"| balls looked for, with 4 frames, 12 and 36, each | {_two(balls.mean(0))} |",
        "",
        f"{os.cpu_count()} cores, load average {os.getloadavg()[0]:.1f}: wall seconds are the machine's with all else "
        "that runs on it. Bar: 5 s; stretch: 2 s.",
    ]


def _two(pair: np.ndarray) -> str:
    return f"{pair[0]:.2f} | {pair[1]:.2f}"


def kills() -> list[str]:
    """Count the photographs that are lost or doubled by kills."""
    from fixtures.hasty_writers import killed_watch

    with tempfile.TemporaryDirectory() as place:
        found = killed_watch(Path(place), count=200, kills=20)
    return [
        f"{found.photographs} photographs by four writers (half files, files written twice, renamed, begun and "
        f"deleted, out of order), the watch ended by SIGKILL at {found.kills} moments and started again: "
        f"**{len(found.lost)} lost, {len(found.doubled)} doubled**, each compared pixel by pixel with its file."
    ]


def idle() -> list[str]:
    """Measure the processor time of a watch on a folder in which nothing happens any more."""
    from fixtures.hasty_writers import content

    with tempfile.TemporaryDirectory() as place:
        hot = Path(place) / "hot"
        hot.mkdir()
        for number in range(FILES):
            (hot / f"shot_{number:03d}.dng").write_bytes(content(number))
        words = [sys.executable, "-c", "from rgbn.cli import main; main()", "watch", str(hot), "--out", f"{place}/out"]
        watch = subprocess.Popen(words, cwd=ROOT, stderr=subprocess.DEVNULL)
        ledger = Path(place) / "out" / ".rgbn" / "watch" / "ledger.json"
        while not ledger.is_file() or len(json.loads(ledger.read_text())["taken"]) < FILES:
            time.sleep(1)
        # Until what takes seconds is done too: two looks without work.
        before, last = _spent(watch.pid), time.monotonic()
        while time.monotonic() - last < 10:
            time.sleep(1)
            now = _spent(watch.pid)
            before, last = (now, time.monotonic()) if now - before > 0.5 else (before, last)
        start, first = time.monotonic(), _spent(watch.pid)
        time.sleep(IDLE_S)
        share = (_spent(watch.pid) - first) / (time.monotonic() - start)
        watch.kill()
        watch.wait()
    told = f"{FILES} photographs in the folder, nothing happens for {IDLE_S:.0f} s"
    return [f"{told}: **{share:.2%}** of one core. Bar: 2 %; stretch: 0.5 %."]


def _spent(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


PARTS = {"verdict": verdicts, "kills": kills, "idle": idle}


def main() -> None:
    from benchmarks.pages import put

    WORK.mkdir(exist_ok=True)
    for name in sys.argv[1:] or PARTS:
        put(PAGE, name, "\n".join([*PARTS[name](), ""]))


if __name__ == "__main__":
    main()
