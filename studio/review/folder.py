"""What the output folder of a session holds to be reviewed, and why the rest is not there."""

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from capture.session.session import load_session
from capture.session.session_types import Session
from compare.report.facts import Material, all_warnings, read_optional
from lab.session_place import SESSION, is_output, is_session, session_and_out, session_of
from scene.errors import SceneError, SessionError
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.output_folder import read_record
from scene.spheres import Sphere
from scene.store import Store
from twin.description.object_mesh import ObjectMesh

if TYPE_CHECKING:
    from scene.rays import RayCaster

Array = NDArray[np.float64]
KEPT = "review"
"""Folder below the output folder: the session with what was corrected."""
HEADLINE = "# Written by rgbn studio: the session as its own session.toml has it, and what was corrected."
"""First line of its session.toml: what may be written over."""
OWN = "# Its own: "
"""Begins the second line, which names the session that was corrected."""
UNREADABLE = (OSError, ValueError, KeyError, TypeError, SceneError)
"""What a part that is missing, or that a killed run left half-made, raises when it is read."""


@dataclass(frozen=True)
class Warned:
    """A warning of a step.

    frames: That it names, in the order in which it names them.
    ball: That it names first.
    """

    step: str
    text: str
    frames: tuple[int, ...] = ()
    ball: int | None = None


@dataclass(frozen=True)
class Review:
    """An output folder as it was when it was read; a part that is not there is None.

    session_path: The session's folder, or its .toml file.
    why_no_session: Empty where there is one.
    material: Frames, camera, mask, and what the report shows of balls and lights.
    highlights_px (S, F, 2): Where each ball mirrors each flash, NaN where nothing was seen or believed.
    position_covariance_mm2 (F, 3, 3): Of near lights; None of distant ones, and where the folder does not say.
    truth (H, W, 3): Normals of the registered scan, NaN where unknown.
    twin: The rendered frames.
    done: The steps that ended.
    clipped_share (F,): Of each frame's pixels, as the audit counted them.
    """

    store: Store
    session_path: Path | None
    session: Session | None
    why_no_session: str
    material: Material
    lights: Lights | None
    spheres: tuple[Sphere, ...]
    highlights_px: Array | None
    position_covariance_mm2: Array | None
    truth: NDArray[np.float32] | None
    twin: Frames | None
    warnings: tuple[Warned, ...]
    done: frozenset[str]
    clipped_share: Array | None

    @classmethod
    def read(cls, folder: Path, session_path: Path | None = None) -> "Review":
        """Read an output folder, and the session, None: its own."""
        store = Store(folder)
        record = read_record(folder)
        steps = {} if record is None else record.done
        material = Material.load(store, {})
        spheres = tuple(_readable(store.load_spheres) or ())
        calibration = read_optional(store, "calibration.json") or {}
        session, path, why = _session(store, session_path)
        names = () if material.frames is None else material.frames.names
        warned = {step: entry.get("warnings") or () for step, entry in steps.items() if isinstance(entry, dict)}
        rows = [{"step": step, "text": str(text)} for step, texts in warned.items() for text in texts]
        texts = all_warnings({"warnings": rows})
        return cls(
            store,
            path,
            session,
            why,
            material,
            _readable(lambda: _known_lights(store)),
            spheres,
            _array(calibration.get("highlights_px"), (len(spheres), len(names), 2)),
            _array(calibration.get("position_covariance_mm2"), (len(names), 3, 3)),
            _readable(lambda: np.load(store.path("normals", "truth.npy"), mmap_mode="r")),
            _readable(Store(store.path("twin")).load_frames),
            tuple(targets(texts, names, spheres)),
            frozenset(steps),
            _array(_clipped(steps), (len(names),)),
        )

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
    def unfinished(self) -> dict[str, str]:
        """What is not there because its step has not ended: the step by its name."""
        return {name: step for name, (part, step, _) in self._parts.items() if part is None and step not in self.done}

    @cached_property
    def missing(self) -> dict[str, str]:
        """What is not there, and why: a sentence for each of frames, camera, lights, balls, mask, scan, twin."""
        return {
            name: why if step in self.done and why else self._unfinished(step)
            for name, (part, step, why) in self._parts.items()
            if part is None
        }

    def need(self, *names: str) -> list[Any]:
        """Return parts by their names in `missing`, or the `session`. Raises SceneError: why one is not there."""
        for name in names:
            if name == "session" and self.session is None:
                raise SceneError(self.why_no_session)
            if name in self.missing:
                raise SceneError(f"{name}: {self.missing[name]}")
        return [self.session if name == "session" else self._parts[name][0] for name in names]

    @cached_property
    def scan_mesh(self) -> Mesh:
        """The session's scan. Raises SceneError: there is none, or it cannot be read."""
        from align.scan.mended_scan import load_scan

        session = self.session
        if session is None or session.scan is None:
            raise SceneError(self.why_no_session or "object.scan: the session names no scan. Add it to session.toml.")
        return load_scan(session.scan, session.scan_unit, ball_diameter_mm=session.scan_ball_diameter_mm)

    @cached_property
    def scan_shape(self) -> ObjectMesh:
        """The same as what the views show."""
        return ObjectMesh(self.scan_mesh.vertices, self.scan_mesh.faces)

    @cached_property
    def scan_rays(self) -> "RayCaster":
        """Its tree, which takes a second for a large scan."""
        from scene import rays

        return rays.RayCaster(self.scan_mesh)

    def _unfinished(self, step: str) -> str:
        if step in self.done:
            return f"the step `{step}` ended, but its files are not there or cannot be read. Run it again."
        return f"the step `{step}` has not ended here. **Run the steps** says what stops it."


def _readable(read: Callable[[], Any]) -> Any:
    """Return what can be read, else None."""
    with suppress(*UNREADABLE):
        return read()


def _known_lights(store: Store) -> Lights | None:
    lights = store.load_lights()
    return None if lights.is_unknown else lights


def found_at(source: Path, out: Path | None) -> tuple[Path, Path | None]:
    """Return the output folder, and the session's place or None, that a command line means.

    out: The output folder of a session; None: out/NAME. An output folder can be looked at without its session.
    """
    if not is_output(source) and not is_session(source):
        raise SceneError(
            f"{source}: neither a session (session.toml) nor an output folder of rgbn ({SESSION}). Give one of these, "
            "or a scene description, .toml."
        )
    try:
        session, folder = session_and_out(source, out)
    except SessionError:
        if not is_output(source):
            raise
        session, folder = None, source
    return folder.resolve(), session


def is_kept(store: Store) -> bool:
    """Whether corrections were kept in an output folder."""
    path = store.path(KEPT, "session.toml")
    return path.is_file() and path.read_text("utf-8-sig", "replace").startswith(HEADLINE)


def _own(store: Store, path: Path) -> Path:
    """Return the session that a session is the correction of, where it is one and that is there; else itself."""
    if path.resolve() != store.path(KEPT).resolve() or not is_kept(store):
        return path
    second = (path / "session.toml").read_text("utf-8-sig", "replace").splitlines()[1]
    own = Path(second.removeprefix(OWN))
    is_there = own.is_file() or (own / "session.toml").is_file()
    return own if second.startswith(OWN) and is_there else path


def _session(store: Store, given: Path | None) -> tuple[Session | None, Path | None, str]:
    """Return the session, where it lies, and why there is none."""
    remedy = f"Open the review with `rgbn studio SESSION --out {store.folder.name}` to correct and run again."
    try:
        path = _own(store, given or session_of(store.folder))
        return load_session(path), path.resolve(), ""
    except SceneError as error:
        return None, None, f"The session cannot be read: {error} {remedy}"


def _clipped(steps: dict[str, Any]) -> list[Any]:
    with suppress(KeyError, TypeError):
        return [row.get("saturated_share") for row in steps["check"]["result"]["frames_table"]]
    return []


def _array(rows: Any, shape: tuple[int, ...]) -> Array | None:
    """Return nested lists as an array, null as NaN; None where they have another shape."""
    with suppress(ValueError, TypeError):
        found = np.array(rows, np.float64)
        return found if found.shape == shape else None
    return None


def targets(texts: Sequence[tuple[str, str]], names: Sequence[str], spheres: Sequence[Sphere]) -> list[Warned]:
    """Return warnings with what they name.

    names: The frames'. spheres: In the order in which `spheres.json` has them, which is that of "ball 2" in a text.
    """
    return [Warned(step, text, _frames(text, names), _ball(text, spheres)) for step, text in texts]


def _frames(text: str, names: Sequence[str]) -> tuple[int, ...]:
    """Return the frames whose names stand in a text as whole words."""
    found = []
    for index, name in enumerate(names):
        # flash_1 is not named by flash_12, nor by flash_1.5; flash_1.dng names it.
        match = re.search(rf"(?<![\w.-]){re.escape(name)}(?!\w|-\w|\.\d)", text)
        if match:
            found.append((match.start(), index))
    return tuple(index for _, index in sorted(found))


def _ball(text: str, spheres: Sequence[Sphere]) -> int | None:
    """Return the ball that a text names by its number, its place, or as the only one of its kind."""
    named = re.search(r"\b(chrome|white) ball (\d+)\b", text)
    if named:
        # Numbers count the balls of one kind.
        return _of_kind(spheres, named[1], int(named[2]) - 1)
    placed = re.search(r"\b(chrome|white) ball at \((-?\d+), (-?\d+)\) px", text)
    if placed and spheres:
        place = [float(placed[2]), float(placed[3])]
        away = [float(abs(sphere.center_px - place).max()) for sphere in spheres]
        nearest = min(range(len(away)), key=away.__getitem__)
        return nearest if away[nearest] < spheres[nearest].radius_px else None
    alone = re.search(r"\bthe (chrome|white) ball\b|\bone (chrome) ball\b", text)
    if alone:
        kind = alone[1] or alone[2]
        return _of_kind(spheres, kind, 0) if sum(sphere.kind == kind for sphere in spheres) == 1 else None
    return None


def _of_kind(spheres: Sequence[Sphere], kind: str, number: int) -> int | None:
    places = [index for index, sphere in enumerate(spheres) if sphere.kind == kind]
    return places[number] if 0 <= number < len(places) else None
