"""What the output folder of a session holds to be reviewed, and why the rest is not there."""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.session.session import load_session
from capture.session.session_types import CaptureSession, Encoding
from capture.survey.small_pictures import read_small
from compare.report.facts import Material, all_warnings, read_optional, there
from compare.report.pictures import Exposure, thumbnail
from formats.picture_files import read_values
from lab.options import Settings
from lab.session_place import session_of
from scene.errors import SceneError
from scene.frames import Frames, decode
from scene.lights import Lights
from scene.map_pictures import Image
from scene.mesh import Mesh
from scene.output_folder import read_record
from scene.pose import Pose
from scene.spheres import Sphere
from scene.store import Store
from shoot.init.init_session import SHEET
from shoot.watch.watch_folder import MAP

Array = NDArray[np.float64]
KEPT = "review"
"""Folder below the output folder: the session with what was corrected."""
HEADLINE = "# Written by rgbn studio: the session as its own session.toml has it, and what was corrected."
"""First line of its session.toml."""
OWN = "# Its own: "
"""Begins the second line, which names the session that was corrected."""
SMALL_PX = 200
"""Width of a photograph of which its white is taken."""


class Review:
    """An output folder to be reviewed; each part is read once, and one that is not there is None.

    session, session_path: What it was made of, and its folder or .toml file. why_no_session: Empty where there is one.
    material: Frames, camera, mask, and the methods that have run.
    spheres: Balls in the session's own photographs; those that were shot apart are not shown.
    truth (H, W, 3): Normals of the registered scan, NaN where unknown.
    twin: The rendered frames.
    summary, pose: What those files hold; empty where they are not there.
    steps, done: What is kept of each step that ended, and their names.
    """

    def __init__(self, folder: Path, session_path: Path | None = None) -> None:
        self.store = store = Store(folder)
        record = read_record(folder)
        self._record, self.steps = record, {} if record is None else record.done
        self.done = frozenset(self.steps)
        self.session, self.session_path, self.why_no_session = _session(store, session_path)
        self.material = material = Material(store, {})
        if material.frames is not None and material.lights is None:
            # As long as no light tells what is white, it is what the photograph itself takes for it.
            look = Exposure.for_picture(thumbnail(material.frames, 0, SMALL_PX))
            material.exposure = Exposure.for_frames(material.frames, white_value=look.balance)
        self._balls: tuple[Sphere, ...] = tuple(there(store.load_spheres) or ())
        self.spheres: tuple[Sphere, ...] = tuple(sphere for sphere in self._balls if not sphere.apart)
        lights: Lights | None = there(store.load_lights)
        self.lights = None if lights is None or lights.is_unknown else lights
        self.truth = there(material.map_of, "normals", "truth")
        self.twin: Frames | None = material.twin_frames
        self._calibration, self.summary, self.pose = (
            found if isinstance(found := read_optional(store, f"{name}.json"), dict) else {}
            for name in ("calibration", "summary", "pose")
        )

    @cached_property
    def programs(self) -> tuple[str, ...]:
        """Other ones that a run would start, as before: a folder from elsewhere may name any."""
        return Settings.of(self._record).external or ()

    @property
    def names(self) -> tuple[str, ...]:
        """Of the frames."""
        return () if self.material.frames is None else self.material.frames.names

    @cached_property
    def highlights_px(self) -> Array | None:
        """(S, F, 2), where each ball mirrors each flash, NaN where nothing was seen or believed."""
        found = _array(self._calibration.get("highlights_px"), (len(self._balls), len(self.names), 2))
        return None if found is None else found[[not sphere.apart for sphere in self._balls]]

    @cached_property
    def clipped_share(self) -> Array | None:
        """(F,), of each frame's pixels, as the audit counted them."""
        with suppress(KeyError, TypeError):
            rows = self.steps["check"]["result"]["frames_table"]
            return _array([row.get("saturated_share") for row in rows], (len(self.names),))
        return None

    @cached_property
    def warnings(self) -> "list[Warned]":
        """Of all steps, with what each is about."""
        told = {step: entry.get("warnings") or () for step, entry in self.steps.items() if isinstance(entry, dict)}
        rows = [{"step": step, "text": str(text)} for step, texts in told.items() for text in texts]
        found = all_warnings({"warnings": rows})
        return [Warned(step, text, frames_named(text, self.names)) for step, text in found]

    @cached_property
    def _parts(self) -> dict[str, tuple[Any, str, str]]:
        """What is there by its name, the step that leaves it, and why that may leave none."""
        material, has_scan = self.material, self.session is None or self.session.scan is not None
        # Lights that are there and of no use are unknown ones.
        unknown = "no ball was found, and no file gives them: they are unknown." if material.lights else ""
        no_scan = "the session names no scan ([object] scan), so nothing was registered."
        return {
            "frames": (material.frames, "check", ""),
            "camera": (material.camera, "check", ""),
            "balls": (self.spheres or None, "calibrate", "no ball was found or asked for."),
            "lights": (self.lights, "calibrate", unknown),
            "mask": (material.mask, "align", ""),
            "scan": (self.truth, "align", "" if has_scan else no_scan),
            "twin": (self.twin, "twin", "there is no registered scan to render."),
        }

    @cached_property
    def missing(self) -> dict[str, str]:
        """What is not there, and why: a sentence for each of frames, camera, lights, balls, mask, scan, twin."""
        gone = "the step `{}` ended, but its files are not there or cannot be read. Run it again."
        return {
            name: (why or gone.format(step)) if step in self.done else f"the step `{step}` has not ended here."
            for name, (part, step, why) in self._parts.items()
            if part is None
        }

    @property
    def lacks(self) -> str:
        """What no step has made yet, as Markdown; empty: nothing."""
        names = [name for name, (part, step, _) in self._parts.items() if part is None and step not in self.done]
        return f"**{', '.join(names)}**: not made yet. **Run** makes them, or says what stops it." if names else ""

    def need(self, *names: str) -> list[Any]:
        """Return parts by their names in `missing`, or the `session`. Raises SceneError: why one is not there."""
        for name in names:
            if name == "session" and self.session is None:
                raise SceneError(self.why_no_session)
            if name in self.missing:
                raise SceneError(f"{name}: {self.missing[name]}")
        return [self.session if name == "session" else self._parts[name][0] for name in names]

    @cached_property
    def preview(self) -> Image | None:
        """A picture for as long as no photograph is decoded: of a shoot, what `rgbn init` saw, the first; or None."""
        for path in map(self.store.path, (MAP, SHEET)):
            if path.is_file():
                return there(lambda path=path: read_values(path)[0])
        return first_look(self.session.flash[0], self.session.encoding) if self.session else None

    @cached_property
    def scan_mesh(self) -> Mesh:
        """The session's scan. Raises SceneError: there is none, or it cannot be read."""
        from align.scan.mended_scan import load_scan

        session = self.session
        if session is None or session.scan is None:
            raise SceneError(self.why_no_session or "object.scan: the session names no scan. Add it to session.toml.")
        return load_scan(session.scan, session.scan_unit, ball_diameter_mm=session.scan_ball_diameter_mm)

    @cached_property
    def placed_scan(self) -> tuple[Mesh, Pose] | None:
        """The registered scan in millimetres, and its pose; None: there is none."""
        if self.session is None or self.session.scan is None or not self.store.path("pose.json").exists():
            return None
        mesh = self.scan_mesh
        return Mesh(self.store.load_scan_scale() * mesh.vertices, mesh.faces), self.store.load_pose()


def first_look(path: Path, encoding: Encoding = "linear") -> Image | None:
    """Return a photograph small, as 8 bits (h, w, 3); None: it cannot be read."""
    with suppress(OSError, ValueError, SceneError):
        (small,), _ = read_small([path], encoding)
        linear = decode(small.codes)
        return Exposure.for_picture(linear).develop(linear)
    return None


def is_kept(store: Store) -> bool:
    """Whether corrections were kept in an output folder."""
    path = store.path(KEPT, "session.toml")
    return path.is_file() and path.read_text("utf-8-sig", "replace").startswith(HEADLINE)


def _session(store: Store, given: Path | None) -> tuple[CaptureSession | None, Path | None, str]:
    """Return the session, where it lies, and why there is none."""
    try:
        path = given or session_of(store.folder)
        if path.resolve() == store.path(KEPT).resolve() and is_kept(store):
            # The session that it is the correction of, if that is there.
            second = (path / "session.toml").read_text("utf-8-sig", "replace").splitlines()[1]
            own = Path(second.removeprefix(OWN))
            if second.startswith(OWN) and (own.is_file() or (own / "session.toml").is_file()):
                path = own
        return load_session(path), path.resolve(), ""
    except SceneError as error:
        remedy = f"Open the review with `rgbn studio SESSION --out {store.folder.name}` to correct and run again."
        return None, None, f"The session cannot be read: {error} {remedy}"


def _array(rows: Any, shape: tuple[int, ...]) -> Array | None:
    """Return nested lists as an array, null as NaN; None where they have another shape."""
    with suppress(ValueError, TypeError):
        found = np.array(rows, np.float64)
        return found if found.shape == shape else None
    return None


STEPS = {"Capture": "check", "Balls": "calibrate", "Lights": "calibrate", "Scan": "align", "Solve": "solve",
         "Twin": "twin", "Verdict": "compare"}  # fmt: skip
"""The tabs of a session, each with the step of `lab.run` up to which its button runs."""


@dataclass(frozen=True)
class Warned:
    """A warning of a step; frames: That it names, in the order in which it names them."""

    step: str
    text: str
    frames: tuple[int, ...] = ()


def frames_named(text: str, names: Sequence[str]) -> tuple[int, ...]:
    """Return the frames whose names stand in a text as whole words."""
    # flash_1 is not named by flash_12, nor by flash_1.5; flash_1.dng names it.
    found = [re.search(rf"(?<![\w.-]){re.escape(name)}(?!\w|-\w|\.\d)", text) for name in names]
    return tuple(index for _, index in sorted((match.start(), index) for index, match in enumerate(found) if match))
