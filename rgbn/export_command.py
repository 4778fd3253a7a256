"""`rgbn export --format`: what other programs get: lights, photographs, a relightable picture, the twin's scene."""

import re
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from compare.report.pictures import Exposure
from formats.light_files.light_formats import WRITTEN, export_lights
from formats.picture_files import srgb_from_linear
from formats.relight_files import tell, terms, write_relight
from formats.sfm_data import write_sfm
from lab.job import Job
from lab.options import AS_BEFORE, Out, Settings, named
from lab.progress import is_quiet, say
from lab.results import pixel_size_mm
from lab.run import EXPORTED, STEPS, is_description, open_job, summed_up
from lab.twin_step import twin_scene
from rgbn.cli import SESSION
from scene.errors import SceneError
from scene.origin import Origin
from scene.output_folder import open_record, own_folder
from twin.description.description import TwinScene
from twin.description.description_file import read_scene

HERITAGE, SCENE = "heritage", "mitsuba"
FORMATS = (*WRITTEN, "relight", HERITAGE, SCENE)

Made = tuple[list[Path], list[str]]
"""Files, and notes: what these cannot say."""
Array = NDArray[np.float64]
MOST_PIXELS = 4_000_000
"""Of the picture: a texture of a viewer's, and few enough to be held."""
MOST_CONDITION = 1e3
"""Of the terms at the lights; beyond it they cannot be told apart."""


def export(
    session: Annotated[Path, Parameter(help=f"{SESSION} Mitsuba also takes a scene's .toml.")],
    /,
    *,
    format: Annotated[
        str,
        Parameter(
            alias="-f",
            help="Formats, with commas: diligent, dome, lp, meshroom, relight, heritage, mitsuba. meshroom: "
            "photographs and camera as SfMData, with AliceVision's lights. relight: one picture for OpenLIME and "
            "RelightLab. heritage: a bag for an archive, with a IIIF manifest. mitsuba: the twin's scene.",
        ),
    ],
    out: Out = None,
    base_url: Annotated[
        str, Parameter(help="Address at which data/ of heritage will be served. Its IIIF ids begin with it.")
    ] = "http://localhost:8000",
    said: Settings = AS_BEFORE,
) -> Made:
    """Write what is asked for into OUT/export, after the steps that it needs: `rgbn export`; and print what it is.

    Raises
    ------
    SceneError
        Unknown format, or one that cannot hold these lights or this scene; a session without a scan has none.
    """
    names = named("--format", format, FORMATS)
    if not re.fullmatch(r"https?://[^\s/?#]+(/[^\s?#]*)?", base_url):
        raise SceneError(
            f"--base-url {base_url}: expected a whole address, such as http://localhost:8000: IIIF asks for such ids."
        )
    if is_description(session) and names == (SCENE,):
        scene, origin = read_scene(session), Origin("scene", session.resolve())
        out = out or own_folder(Path("out") / session.stem, origin)
        with open_record(out, origin=origin, inputs=[session]) as record:
            return _told([_scene(scene, record.folder / "export")])
    made: list[Made] = []
    with open_job(session, out=out, said=said) as job:
        # First what may take steps that remove what the others wrote.
        if HERITAGE in names:
            from rgbn.heritage_export import export_heritage

            made.append(export_heritage(job, base_url.rstrip("/")))
        before = dict(job.done)
        job.run(STEPS, "solve" if SCENE in names else "calibrate")
        if SCENE in names and job.done != before:
            # What was told of the normals that this has replaced.
            summed_up(job, "export")
        if job.store.load_lights().is_unknown and job.session.scan:
            job.run(STEPS, "align")
        for name in names:
            if name != HERITAGE:
                with job.record.part_of(EXPORTED):
                    made.append(_one(job, name))
    return _told(made)


def _told(made: list[Made]) -> Made:
    paths, notes = ([one for part in parts for one in part] for parts in zip(*made, strict=True))
    for note in notes:
        say(f"note: {note}")
    for path in () if is_quiet() else paths:
        print(path)
    return paths, notes


def _one(job: Job, name: str) -> Made:
    store, folder = job.store, job.store.path("export")
    lights, camera = store.load_lights(), store.load_camera()
    if name == SCENE:
        if not store.path("pose.json").exists():
            raise SceneError(
                f'{job.session.name}: no scan is registered, so there is no twin to export. Add [object] scan = "..." '
                "to session.toml."
            )
        scene, found, warnings = twin_scene(job)
        paths, notes = _scene(scene, folder)
        return paths, [f"the object is {found.fit}", *warnings, *notes]
    if name == "relight":
        return export_relight(store, job.session.name)
    if lights.is_unknown:
        lights.check()
    sfm, said = folder / "cameras.sfm", []
    if name == "meshroom":
        said = write_sfm(sfm, camera, [path.resolve() for path in job.session.flash])
    paths, notes = export_lights(folder, name, lights, camera, files=job.frame_files)
    return [*paths, *[sfm] * (name == "meshroom")], [*said, *notes]


def _scene(scene: TwinScene, folder: Path) -> Made:
    """Write scene.xml with all that it names."""
    from twin.engines.mitsuba_files import write_mitsuba

    made, notes = write_mitsuba(scene, folder)
    first = scene.lights.names[0]
    command = f"mitsuba -m llvm_ad_rgb -D light={first} -o {first}.exr {made[0]}"
    return [made[0]], [*notes, f"{len(scene.lights)} lights, one at a time: {command}"]


def export_relight(store: Any, name: str) -> tuple[list[Path], list[str]]:
    """Write OUT/export/relight from a calibrated session; return the files, and notes: the error.

    The pictures that are fitted are those that people see: sRGB, each divided by its flash's intensity, and by its
    fall-off at the depth of the lights' reference point. Directions are those at the reference point, as a viewer has
    one light for all pixels. The residual of a sample by a fit to all other photographs is r / (1 - h), h the
    photograph's element of the hat matrix' diagonal [Allen1974].

    Raises SceneError: the lights are too few, or in one plane or ring, for the terms.
    """
    frames, lights, camera = store.load_frames(), store.load_lights(), store.load_camera()
    lights.check()
    matrix = terms(lights.directions).astype(np.float32)
    if len(matrix) <= matrix.shape[1] or np.linalg.cond(matrix) > MOST_CONDITION:
        raise SceneError(
            f"relight: {len(matrix)} lights where these stand do not tell {matrix.shape[1]} terms of the light's "
            "direction. Seven lights or more, not all on one ring, are needed."
        )
    inverse = np.linalg.pinv(matrix)
    unseen = 1 / np.maximum(1 - np.einsum("fk,kf->f", matrix, inverse), 1e-6)
    step = int(np.ceil(np.sqrt(max(1.0, frames.width * frames.height / MOST_PIXELS))))
    exposure = Exposure.for_frames(frames, white_value=lights.white_value)
    u, white = np.arange(0, frames.width, step), exposure.white * exposure.balance

    def pictures(row: int) -> NDArray[np.float32]:
        """Return what is fitted of one row: (F, w, 3)."""
        pixels = np.stack([u, np.full(len(u), row)], 1).astype(float)
        points = camera.points_at_depth(pixels, float(lights.reference_point_mm[2]))
        strength = np.linalg.norm(lights.toward(points), axis=-1)[..., None] * lights.intensities[:, None]
        linear = frames.read(slice(row, row + 1), columns=slice(None, None, step))[:, 0]
        return srgb_from_linear(np.clip(linear / np.maximum(strength, 1e-6) / white, 0, 1)).astype(np.float32)

    rows = range(0, frames.height, step)
    folder = store.path("export", "relight")
    coefficients = np.stack([np.einsum("kf,fwc->kwc", inverse, pictures(row)) for row in rows], 1)
    pixel_mm = pixel_size_mm(camera, lights)
    paths = write_relight(folder, name, coefficients, lights.directions, pixel_mm and step * pixel_mm)
    squares = []
    for index, row in enumerate(rows):
        values = pictures(row)
        fitted = np.einsum("fk,kwc->fwc", matrix, np.einsum("kf,fwc->kwc", inverse, values))
        # By the files: what eight bits and JPEG cost is in it.
        shown = np.clip(np.einsum("fk,kwc->fwc", matrix, coefficients[:, index]), 0, 1)
        squares.append((np.mean((shown - values) ** 2), np.mean(((values - fitted) * unseen[:, None, None]) ** 2)))
    rms, left_out = np.sqrt(np.mean(squares, 0)).tolist()
    tell(folder, {"rms": rms, "left_out_rms": left_out})
    notes = [
        f"relight: {len(coefficients)} terms; misses the photographs by {100 * rms:.1f} % of white (rms, "
        f"sRGB), photographs that it was not fitted to by {100 * left_out:.1f} %",
        f"relight: {folder.name}/index.html shows it with OpenLIME's openlime.min.js, skin.svg and skin.css beside it, "
        "served over http",
    ]
    return paths, notes
