"""`import rgbn`: a session opened in Python; what is asked for is computed where it is not done and current."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.session.session import load_session
from lab.job import Job
from lab.options import Settings, Solving, TwinSettings
from lab.run import STEPS, run_session
from lab.session_place import origin_of, session_and_out
from rgbn.result_tables import Table, ball_table, error_table
from scene.camera import Camera
from scene.errors import SceneError
from scene.estimate import Estimate
from scene.frames import Frames
from scene.lights import Lights
from scene.method_names import METHODS
from scene.normals import angular_error_deg
from scene.output_folder import open_record, read_record
from scene.pose import Pose
from scene.spheres import Sphere
from scene.store import Store

Method = Solving | str | None


class Session:
    """A session and its output folder; `rgbn.open` is this.

    The verbs are the command line's steps: `check`, `calibrate`, `align`, `solve`, `twin`, `compare`. Each runs what is
    not done and current yet, as the output folder was made unless something else is said, and returns the session, so
    that `session.calibrate().lights` is one line. A property runs the step that it needs, if that is not done and
    current.

    Vectors are in the camera frame: x right, y up, z toward the viewer. Arrays are [row, column].

    Parameters
    ----------
    path : str or Path
        Folder with session.toml, or in the DiLiGenT layout; or an output folder, which is then gone on with.
    out : str or Path, optional
        Output folder: new, empty or rgbn's own. Default: out/NAME here, by the session's name.
    scheduler : str, optional
        Address of a Dask scheduler.
    truth : str or Path, optional
        Folder of a known truth (truth.json, truth.npz) to judge the results by. Default: as the output folder was made.

    Raises
    ------
    SceneError
        The session cannot be read: every fault at once. By verbs and properties: the input is at fault, or what is
        asked for cannot be had of this session.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        out: str | Path | None = None,
        scheduler: str | None = None,
        truth: str | Path | None = None,
    ) -> None:
        self.path, folder = session_and_out(Path(path), None if out is None else Path(out))
        self._scheduler = scheduler
        self._said = Settings(truth=None if truth is None else Path(truth).resolve())
        # Faults of the session are told now; nothing runs yet.
        _ = self._session
        self.out = folder.resolve()

    def check(self) -> "Session":
        """Decode the capture and audit it."""
        return self._run("check")

    def calibrate(self) -> "Session":
        """Find the balls, and from them the lights."""
        return self._run("calibrate")

    def align(self) -> "Session":
        """Find the object, register its scan, write the ground truth."""
        return self._run("align")

    def solve(self, solving: Method = None) -> "Session":
        """Recover normals and albedo.

        Parameters
        ----------
        solving : str or Solving, optional
            Methods, with commas, beside those whose results are there; or more of how they run. Default: those whose
            results are there, else `ls,iterative`. When one is added, all are solved again.
        """
        return self._run("solve", solving)

    def twin(self, solving: Method = None, twin: TwinSettings | None = None) -> "Session":
        """Render the registered scan, and solve the rendering by the same methods."""
        return self._run("twin", solving, twin)

    def compare(self, solving: Method = None, twin: TwinSettings | None = None) -> "Session":
        """Go the whole way, compare all with the truth, and write report.html."""
        return self._run("compare", solving, twin)

    def _run(self, wanted: str, solving: Method = None, twin: TwinSettings | None = None) -> "Session":
        run_session(self.path, wanted, out=self.out, scheduler=self._scheduler, said=self._with(solving, twin))
        return self

    process = compare

    @property
    def summary(self) -> dict[str, Any]:
        """Every number so far: summary.json. Runs `check` where nothing is done yet."""
        return self._told or self.check()._told

    @property
    def warnings(self) -> "Table[dict[str, Any]]":
        """The warnings so far, each with its step."""
        rows = self.summary["warnings"]
        return Table(rows, f"{len(rows)} warning{'s' * (len(rows) != 1)}")

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods whose results are there."""
        return tuple((self._told.get("solve") or {}).get("methods") or ())

    @property
    def store(self) -> Store:
        """The files of the output folder."""
        return Store(self.out)

    @property
    def frames(self) -> "Frames":
        """The photographs, linear, memory-mapped. Runs `check`."""
        self._need("check")
        return self.store.load_frames()

    @property
    def camera(self) -> "Camera":
        """The camera, corrected by the balls once they are found. Runs `check`."""
        self._need("check")
        return self._as_of("calibrate").load_camera()

    @property
    def spheres(self) -> "Table[Sphere]":
        """The calibration balls that were found, `scene.spheres.Sphere`. Runs `calibrate`."""
        self._need("calibrate")
        return ball_table(self.store.load_spheres(), self.camera, self.store.load_frames())

    @property
    def lights(self) -> "Lights":
        """The flashes: directions (F, 3), positions_mm (F, 3), intensities (F, 3), sigmas. Runs `calibrate`.

        Directions and intensities hold at `reference_point_mm`: amid the balls, and once `align` is done at the
        object's centre.
        """
        self._need("calibrate")
        return self._as_of("align").load_lights()

    @property
    def mask(self) -> "NDArray[np.bool_]":
        """The object's pixels, (H, W). Runs `align`."""
        self._need("align")
        return self.store.load_mask()

    @property
    def pose(self) -> "Pose":
        """The scan's pose, camera from scan, mm. Runs `align`."""
        if self._session.normals or not self._session.scan:
            raise self._lacks("pose", "names no scan, or given normals", 'Give [object] scan = "...", and no normals')
        self._need("align")
        return self.store.load_pose()

    @property
    def truth(self) -> "NDArray[np.float32]":
        """Ground-truth normals, (H, W, 3), unit, NaN where unknown. Runs `align`."""
        self._require_truth("ground truth")
        self._need("align")
        return self.store.load_normals("truth")

    def normals(self, method: str, *, twin: bool = False) -> "NDArray[np.float32]":
        """Return a method's normals, or those of the twin, (H, W, 3), unit, NaN where unknown. Runs `solve`, `twin`."""
        store, name = self._solved(method, twin)
        return store.load_normals(name)

    def albedo(self, method: str, *, twin: bool = False) -> "NDArray[np.float32]":
        """Return a method's albedo, (H, W, 3), RGB, relative, NaN where unknown. Runs `solve`, `twin`."""
        store, name = self._solved(method, twin)
        return store.read_array("albedo", f"{name}.npy")

    def estimate(self, method: str, *, twin: bool = False) -> "Estimate":
        """Return all that a method found, with its own sigma and warnings. Runs `solve`, `twin`."""
        store, name = self._solved(method, twin)
        row = {} if twin else self._told["solve"]["methods"][name]
        told = {key: row[key] for key in ("seconds", "settings") if key in row}
        return store.load_estimate(name, **told, warnings=tuple(row.get("warnings") or ()))

    def error_deg(self, method: str, *, twin: bool = False) -> "NDArray[np.float32]":
        """Return the angle between a method's normals and the truth, (H, W) degrees, NaN where unknown."""
        return angular_error_deg(self.truth, self.normals(method, twin=twin)).astype("float32")

    @property
    def errors(self) -> "Table[dict[str, Any]]":
        """The methods' angular errors, on the photographs and on the twin. Runs `compare`."""
        self._require_truth("error")
        self._need("compare")
        return error_table(self._told["compare"])

    @property
    def report(self) -> Path:
        """The path of report.html. Runs `compare`."""
        if not (self.out / "report.html").is_file() or not self._is_current("compare"):
            self.compare()
        return self.out / "report.html"

    def __repr__(self) -> str:
        done = ", ".join(self._told.get("seconds") or ()) or "nothing"
        return f"session {self.path}\noutput  {self.out}; done: {done}"

    @property
    def _session(self) -> Any:
        """The session as session.toml says it now."""
        return load_session(self.path)

    @property
    def _told(self) -> dict[str, Any]:
        """summary.json, empty where there is none."""
        return self.store.read_json("summary.json") if (self.out / "summary.json").is_file() else {}

    def _as_of(self, step: str) -> Store:
        """Return where camera and lights lie: as a step left them, or as they were before the later steps had a say."""
        return self.store if self._is_current(step) else Store(self.out / "frames")

    def _need(self, wanted: str, solving: Method = None) -> None:
        """Run a step where it is not done and current."""
        if not self._is_current(wanted, solving):
            self._run(wanted, solving)

    def _is_current(self, wanted: str, solving: Method = None) -> bool:
        """Whether a step, and all that it needs, is done and current."""
        session = self._session
        with open_record(self.out, origin=origin_of(session, self.path), input_folders=[session.folder]) as record:
            return Job(session, record, Settings.of(record).but(self._with(solving))).is_current(STEPS, wanted)

    @property
    def _kept(self) -> Settings:
        """How the folder was made."""
        return Settings.of(read_record(self.out))

    def _with(self, given: Method, twin: TwinSettings | None = None) -> Settings:
        """Return what is said: methods beside those whose results are there; another program stays with the folder."""
        asked = given if isinstance(given, Solving) else Solving(None if given in self._kept.programs() else given)
        if asked.method is not None:
            there = [name for name in self.methods if name in METHODS]
            asked = replace(asked, method=",".join(dict.fromkeys([*there, *asked.methods()])))
        return self._said.but(asked, twin)

    def _solved(self, method: str, twin: bool) -> tuple[Store, str]:
        """Return where a method's results lie and its name, after they are made where they are not there."""
        name = method.strip() if method.strip() in self._kept.programs() else method.strip().casefold()
        if not twin:
            self._need("solve", name)
            return self.store, name
        if not self._session.scan:
            raise self._lacks("twin", "names no scan", 'Give [object] scan = "..."')
        self._need("twin", name)
        return Store(self.out / "twin"), name

    def _require_truth(self, what: str) -> None:
        if not (self._session.scan or self._session.normals):
            cure = 'Give [object] scan = "...", or normals = "..." that fit the photographs'
            raise self._lacks(what, "names neither a scan nor normals", cure)

    def _lacks(self, what: str, why: str, cure: str) -> SceneError:
        return SceneError(f"{self.path}: there is no {what}: session.toml {why}. {cure}.")
