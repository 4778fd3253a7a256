"""`rgbn twin SCENE.toml`: a scene description rendered to a session's folder."""

import json as json_module
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lab.options import TwinSettings
from lab.progress import logged, progress_bar, say
from scene.current import code_fingerprint, fingerprint
from scene.errors import SceneError
from scene.files import write_json
from scene.origin import Origin
from scene.output_folder import open_record, own_folder
from scene.store import Store

FACTS, RENDERING = "rendering.json", "rendering"


def render_description(source: Path, out: Path | None, twin: TwinSettings, *, json: bool = False) -> Path:
    """Render a scene description to a folder that `rgbn process` takes; return its session.toml.

    Parameters
    ----------
    source : Path
        The .toml.
    out : Path or None
        Default: out/NAME. Gets session.toml, flash/, lights.json, mask.png, truth.npy, true maps, rendering.json.
    twin : TwinSettings
    json : bool
        Print the facts of the rendering as JSON.

    Raises
    ------
    SceneError
        The description is at fault, or the folder holds something else.
    """
    from twin.description.description_file import read_scene

    if twin.photograph:
        raise SceneError("--photograph is for a session's twin. A scene description has [camera.sensor].")
    scene = read_scene(source)
    scene = replace(scene, sampling=twin.sampling(scene.sampling))
    origin = Origin("scene", source.resolve())
    out = out or own_folder(Path("out") / source.stem, origin)
    with open_record(out, origin=origin, inputs=[source]) as record, logged(record):
        folder = Store(record.folder)
        mark = fingerprint(scene, bool(twin.layers), code=code_fingerprint("experiments"))
        if record.is_current(RENDERING, mark):
            say(f"{scene.name}: rendered already")
        else:
            with record.making(RENDERING, mark):
                write_json(folder.path(FACTS), _render(scene, folder, bool(twin.layers)))
        print(json_module.dumps(folder.read_json(FACTS), indent=1) if json else folder.path("session.toml"))
    return folder.path("session.toml")


def _render(scene: Any, folder: Store, apart: bool) -> dict[str, Any]:
    from twin.engines.render import render_scene
    from twin.twin_session import Shooting, write_session

    with progress_bar("twin") as progress:
        rendered = render_scene(scene, apart=apart, store=folder, progress=progress, tell=say)
    for warning in rendered.warnings:
        say(f"warning: {warning}", always=True)
    mask, normals = (np.load(folder.path(f"truth_{name}.npy")) for name in ("mask", "normals"))
    with progress_bar("write") as progress:
        write_session(
            folder,
            rendered.frames,
            scene.camera,
            scene.lights,
            _marked(mask),
            normals,
            shooting=Shooting(scene.sensor, scene.files),
            name=scene.name,
            ambient=rendered.standing,
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
