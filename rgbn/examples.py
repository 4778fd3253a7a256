"""Small sessions to try rgbn on, all made from the one that comes with it; nothing is fetched."""

import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import NamedTuple

from scene.errors import SceneError

SESSION = "session.toml"
TRUTH = ("truth.json", "truth.npz")


def fixture_folder() -> Path:
    """Return the folder of the session that comes with rgbn: in the installed package, else in the checkout."""
    here = Path(__file__).resolve().parent
    return next(place for place in (here / "fixture", here.parent / "fixtures" / "bumpy") if place.is_dir())


class Example(NamedTuple):
    """A session of the shelf: what it shows, and how it differs from the fixture."""

    words: str
    without: tuple[str, ...] = TRUTH  # files and folders
    cut: str = ""  # session.toml's text from here on is left out
    edits: tuple[tuple[str, str], ...] = ()  # in session.toml, each there


def example(name: str, folder: str | Path | None = None) -> Path:
    """Unpack a small session to try rgbn on.

    Parameters
    ----------
    name : str
        `fixture`: photographs, balls, scan and known truth; `no-scan`; `known-lights`: a light file and no balls;
        `no-session-toml`: photographs and scan alone, for `rgbn init`; `wrong`: with mistakes, to see what is said of
        them.
    folder : str or Path, optional
        Where to: new, or empty. Default: NAME here.

    Returns
    -------
    Path
        The folder: `rgbn.open` takes it, but that of `no-session-toml`.

    Raises
    ------
    SceneError
        There is no such example, or the folder is there and not empty.

    Examples
    --------
    >>> session = rgbn.open(rgbn.example("fixture"))
    """
    if name not in EXAMPLES:
        raise SceneError(f"example {name}: is unknown; there are {', '.join(EXAMPLES)}.")
    place = Path(name if folder is None else folder)
    if os.path.lexists(place) and not (place.is_dir() and not any(place.iterdir())):
        raise SceneError(f"{place}: is there already, and is no empty folder. Name another one for the example.")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=place.parent, prefix=".example-") as unfinished:
            made = Path(unfinished) / "session"
            # Files alone: an installed package may be read-only, and its modes are not the user's.
            shutil.copytree(fixture_folder(), made, copy_function=shutil.copyfile)
            made.chmod(0o755)
            _change(made, name)
            made.rename(place)
    except OSError as error:
        raise SceneError(f"{place}: the example cannot be written ({error.strerror}). Name another folder.") from error
    return place


def tell_example(name: str | None = None, folder: Path | None = None, /) -> None:
    """Unpack a small session to try rgbn on; without NAME, list them.

    Parameters
    ----------
    name : str, optional
        One of those that are listed.
    folder : Path, optional
        Where to: new, or empty. Default: NAME here.
    """
    if name is None:
        for known, what in EXAMPLES.items():
            print(f"{known:16} {what.words}")
        return
    place = example(name, folder)
    verb = "init" if name == "no-session-toml" else "process"
    print(f"{place}: {EXAMPLES[name].words}\nnext: rgbn {verb} {place}")


def _change(folder: Path, name: str) -> None:
    """Make an example of a copy of the fixture."""
    what, session = EXAMPLES[name], folder / SESSION
    text = session.read_text("utf-8")
    if what.cut:
        text = text[: text.index(what.cut)].rstrip() + "\n"
    for old, new in what.edits:
        assert old in text, old
        text = text.replace(old, new)
    session.write_text(text, "utf-8")
    if "lights.lp" in text:
        known = json.loads((folder / "truth.json").read_text("utf-8"))["directions_at_object"]
        files = sorted(path.name for path in (folder / "raw").glob("flash_*"))
        rows = (f"{file} {x:.6f} {y:.6f} {z:.6f}\n" for file, (x, y, z) in zip(files, known, strict=True))
        (folder / "lights.lp").write_text(f"{len(files)}\n{''.join(rows)}", "utf-8")
    for path in (folder / one for one in what.without):
        shutil.rmtree(path) if path.is_dir() else path.unlink()


EXAMPLES = {
    "fixture": Example("photographs, two chrome balls and a white one, a scan, and the known truth", without=()),
    "no-scan": Example(
        "the same photographs and balls without a scan: lights and normals, no errors", ("scan", *TRUTH), "[object]",
        (('name = "bumpy"', 'name = "no-scan"'),),
    ),
    # Directions alone, of flashes that stand near, are good for lights and normals, not for registering a scan.
    "known-lights": Example(
        "light directions from a file, lights.lp, in place of balls; no scan", ("scan", *TRUTH), "[[spheres]]",
        (('name = "bumpy"', 'name = "known-lights"'), ("cy = 228.1", 'cy = 228.1\n\n[lights]\nfile = "lights.lp"\n')),
    ),
    "no-session-toml": Example(
        "photographs and a scan alone, for `rgbn init` to describe", (SESSION, *TRUTH)
    ),
    # Slips that people make. The first four are told at once; the scan's unit shows only in the photographs.
    "wrong": Example(
        "with mistakes in session.toml and a wrong unit: see what is said, and put it right",
        edits=(
            ('name = "bumpy"', 'name = "wrong"'), ("raw/flash_*.dng", "raw/flsh_*.dng"),
            ("width = 640", 'width = "640 px"'), ("diameter_mm = 90.0", "diametre_mm = 90.0"),
            ("scan/object.ply", "scans/object.ply"),
            ('scan_unit = "mm"', 'scan_unit = "m"'),
        ),
    ),
}  # fmt: skip
