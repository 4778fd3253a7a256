"""`rgbn twin SCENE.toml`: a scene description rendered to a session's folder."""

import json as json_module
import math
import shutil
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lab.job import locked
from lab.progress import progress_bar, say
from lab.twin_settings import TwinSettings
from scene.errors import SceneError
from scene.files import write_json
from scene.store import Store

FACTS = "rendering.json"
Bar = Callable[[str], AbstractContextManager[Callable[[int, int], None]]]


def render_description(
    source: Path, out: Path | None, twin: TwinSettings, *, json: bool = False, bar: Bar = progress_bar
) -> Path:
    """Render a scene description to a folder that `rgbn process` takes.

    Parameters
    ----------
    source : Path
        The .toml.
    out : Path or None
        Default: out/NAME. Gets session.toml, flash/, lights.json, mask.png, truth.npy, true maps, rendering.json.
    twin : TwinSettings
    json : bool
        Print the facts of the rendering as JSON.
    bar : callable
        Shows progress: given a label, a context that yields a callback (done, total).

    Returns
    -------
    path : Path
        The session.toml.

    Raises
    ------
    SceneError
        The description is at fault, or the folder holds something else.
    """
    from twin.description_file import read_scene
    from twin.unfinished import mark_of

    if twin.photograph:
        raise SceneError("--photograph is for a session's twin. A scene description has [camera.sensor].")
    scene = read_scene(source)
    scene = replace(scene, sampling=twin.sampling(scene.sampling))
    folder = Store(out or Path("out") / source.stem)
    _check_place(folder, source)
    mark, path = mark_of(scene, twin.layers), folder.path("session.toml")
    with locked(folder.folder):
        done = folder.read_json(FACTS) if folder.path(FACTS).exists() and path.exists() else {}
        if done.get("mark") == mark:
            say(f"{scene.name}: rendered already")
        else:
            done = {"mark": mark, **_render(scene, folder, twin.layers, bar)}
            write_json(folder.path(FACTS), done)
    print(json_module.dumps(folder.read_json(FACTS), indent=1) if json else path)
    return path


def _render(scene: Any, folder: Store, apart: bool, bar: Bar) -> dict[str, Any]:
    from twin.render import render_scene
    from twin.session import write_session

    # What is there is of another scene, or was not finished: its manifest goes first.
    folder.path("session.toml").unlink(missing_ok=True)
    shutil.rmtree(folder.path("flash"), ignore_errors=True)
    with bar("twin") as progress:
        rendered = render_scene(scene, apart=apart, store=folder, progress=progress, tell=say)
    for warning in rendered.warnings:
        say(f"warning: {warning}")
    mask, normals = (np.load(folder.path(f"truth_{name}.npy")) for name in ("mask", "normals"))
    with bar("write") as progress:
        write_session(
            folder,
            rendered.frames,
            scene.camera,
            scene.lights,
            _marked(mask),
            normals,
            sensor=scene.sensor,
            files=scene.files,
            name=scene.name,
            progress=progress,
        )
    return rendered.facts()


def _marked(mask: Any) -> Any:
    """Return a mask that marks something: of a scene that fills the picture a border of 1 % is left out."""
    if mask.mean() < 0.98:
        return mask
    margin = math.ceil(0.01 * max(mask.shape))
    marked = np.zeros_like(mask)
    marked[margin:-margin, margin:-margin] = mask[margin:-margin, margin:-margin]
    return marked


def _check_place(folder: Store, source: Path) -> None:
    """Raise where files that this writes would take the place of others."""
    from twin.session import HEADLINE

    if folder.folder.resolve() == source.resolve().parent:
        raise SceneError(
            f"--out {folder.folder}: the scene description lies there, and the session's files may have the names of "
            "its own. Choose another folder; one inside is fine."
        )
    path = folder.path("session.toml")
    if path.exists() and not path.read_text(errors="replace").startswith(HEADLINE):
        raise SceneError(f"{path}: is a session that rgbn did not render. Choose another folder with --out.")
