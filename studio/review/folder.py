"""What the output folder of a session holds to be reviewed, and why the rest is not there."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from capture.session.session import load_session
from capture.session.session_types import Session
from capture.survey.small_pictures import read_small
from compare.report.facts import Material, all_warnings, read_optional
from compare.report.pictures import Exposure, Image
from lab.session_place import session_of
from scene.errors import SceneError
from scene.frames import Frames, decode
from scene.lights import Lights
from scene.mesh import Mesh
from scene.output_folder import read_record
from scene.spheres import Sphere
from scene.store import Store
from studio.review.warned import Warned, targets
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
UNREADABLE = (OSError, ValueError, KeyError, TypeError, AssertionError, SceneError)
"""What a part that is missing, or that a killed run left half-made, raises when it is read."""


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
    def first_look(self) -> Image | None:
        """The session's first photograph, small, for as long as none is decoded here; None: it cannot be read."""
        with suppress(*UNREADABLE):
            assert self.session is not None
            (small,), _ = read_small(self.session.flash[:1], self.session.encoding)
            linear = decode(small.codes)
            return Exposure.for_picture(linear).develop(linear)
        return None

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
