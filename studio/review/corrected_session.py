"""The session with what was corrected, written into the output folder, where the command line can read it."""

import glob
import tomllib
from pathlib import Path
from typing import Any

from capture.session.session_types import SphereSpec
from formats.toml_text import toml_text
from scene.errors import SceneError
from scene.files import write_text
from scene.reading import reading, text_of
from studio.own_files import put_own, remove_own
from studio.review.folder import HEADLINE, KEPT, OWN, Review

PICKS = "picks.csv"
"""Beside it."""
GLOBS = {"flash", "ambient", "dark", "flat", "charuco", "frames"}
FILES = {"mask", "scan", "normals", "picks", "file"}
"""Keys of a session that name files, by patterns or one each."""


def write_amended(review: Review, *, spheres: tuple[SphereSpec, ...] | None = None, picks: Path | None = None) -> Path:
    """Write OUT/review/session.toml, and return its folder: a session for `rgbn process OUT/review --out OUT`.

    spheres: Instead of the session's `[[spheres]]`; picks: for `object.picks`. None: those of an earlier correction,
    else the session's. Raises SceneError: there is none to correct, or a file that is not the studio's is in the way.
    The user's own session.toml is read and never written. Its relative paths are written out in full.
    """
    path, source = review.store.path(KEPT, "session.toml"), _source(review)
    before = _read(path) if path.exists() and path != source else {}
    data = _in_full(_read(source), source.parent)
    if review.session is not None:
        data["name"] = review.session.name
    if spheres is not None:
        data["spheres"] = [_sphere_table(spec) for spec in spheres]
    elif "spheres" in before:
        data["spheres"] = before["spheres"]
    marked = str(picks.resolve()) if picks is not None else before.get("object", {}).get("picks")
    if marked is not None:
        data["object"] = {**data.get("object", {}), "picks": marked}
    own = [] if path == source else [f"{OWN}{review.session_path}"]
    text = "\n".join([HEADLINE, *own, toml_text(data)])
    put_own(review.store.folder, lambda place: write_text(place / KEPT / path.name, text))
    return path.parent


def forget_kept(review: Review) -> None:
    """Remove what was kept in OUT/review, unless somebody else changed it or the session's own file is not known."""
    path = review.store.path(KEPT)
    if review.session_path is None or review.session_path == path.resolve():
        raise SceneError(
            f"{path / 'session.toml'}: the session that it was made of is not known here, or is gone. Open the review "
            "by that session, `rgbn studio SESSION --out OUT`, to forget what was kept."
        )
    remove_own(review.store.folder, [f"{KEPT}/{name}" for name in ("session.toml", PICKS)])


def _read(path: Path) -> dict[str, Any]:
    with reading(path, "cannot be read as TOML", do="Correct it, or remove it."):
        return tomllib.loads(text_of(path))


def _source(review: Review) -> Path:
    (session,), path = review.need("session"), review.session_path
    if session.layout != "toml":
        raise SceneError(
            f"{session.folder}: is in the DiLiGenT layout, which has no place for balls or picks. Write a "
            "session.toml to correct it."
        )
    assert path is not None
    return path if path.is_file() else path / "session.toml"


def _in_full(value: Any, folder: Path, key: str = "") -> Any:
    """Return a manifest, or the value of a key of it, with its paths absolute."""
    if isinstance(value, dict):
        return {name: _in_full(part, folder, name) for name, part in value.items()}
    if key in GLOBS:
        # Signs in the folder's own name are no wildcards.
        root = Path(glob.escape(str(folder.resolve())))
        return [str(root / pattern) for pattern in ([value] if isinstance(value, str) else value)]
    if key in FILES:
        return str(folder.resolve() / value)
    return [_in_full(part, folder) for part in value] if isinstance(value, list) else value


def _sphere_table(spec: SphereSpec) -> dict[str, Any]:
    assert spec.center_px is not None
    assert spec.radius_px is not None
    diameter = {} if spec.diameter_mm is None else {"diameter_mm": float(spec.diameter_mm)}
    outline = {"center_px": list(map(float, spec.center_px)), "radius_px": float(spec.radius_px)}
    own = {"frames": [glob.escape(str(path)) for path in spec.frames]} if spec.frames else {}
    return {"kind": spec.kind, **diameter, **outline, **own}
