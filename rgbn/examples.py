"""The small session that comes with rgbn, to try it on; nothing is fetched."""

import os
import shutil
from pathlib import Path

from scene.errors import SceneError

EXAMPLES = {"fixture": (), "no-session-toml": ("session.toml", "truth.json", "truth.npz")}
"""What is left out of each."""


def fixture_folder() -> Path:
    """Return the folder of the session that comes with rgbn: in the installed package, else in the checkout."""
    here = Path(__file__).resolve().parent
    return next(place for place in (here / "fixture", here.parent / "fixtures" / "bumpy") if place.is_dir())


def example(name: str, folder: str | Path | None = None) -> Path:
    """Unpack a small session to try rgbn on.

    Parameters
    ----------
    name : str
        `fixture`: photographs, balls, scan and known truth; `no-session-toml`: photographs and scan alone, for
        `rgbn init`.
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
        # Files alone: an installed package may be read-only, and its modes are not the user's.
        left_out = shutil.ignore_patterns(*EXAMPLES[name])
        shutil.copytree(fixture_folder(), place, copy_function=shutil.copyfile, ignore=left_out, dirs_exist_ok=True)
        place.chmod(0o755)
    except OSError as error:
        raise SceneError(f"{place}: the example cannot be written ({error.strerror}). Name another folder.") from error
    return place


def tell_example(name: str = "fixture", folder: Path | None = None, /) -> None:
    """Unpack a small session to try rgbn on.

    Parameters
    ----------
    name : str
        fixture: with balls, scan, truth; no-session-toml: photographs and scan, for `rgbn init`.
    folder : Path, optional
        New or empty folder for it. Default: NAME.
    """
    place = example(name, folder)
    print(f"next: rgbn {'init' if name == 'no-session-toml' else 'process'} {place}")
