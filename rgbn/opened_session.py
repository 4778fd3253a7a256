"""`import rgbn`: a session opened in Python; what is asked for is computed where it is not done and current."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from lab.options import Settings, TwinSettings
from lab.session_place import session_and_out
from rgbn.session_steps import Method, SessionSteps
from scene.errors import SceneError
from scene.store import Store

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rgbn.result_tables import Balls, Errors, Table
    from scene.camera import Camera
    from scene.estimate import Estimate
    from scene.frames import Frames
    from scene.lights import Lights
    from scene.pose import Pose


class Session:
    """A session and its output folder, opened by `rgbn.open`.

    The verbs are the command line's steps: `check`, `calibrate`, `align`, `solve`, `twin`, `compare`. Each runs what is
    not done and current yet, and returns the session, so that `session.calibrate().lights` is one line. A property runs
    the step that it needs, if that is not done and current.

    Vectors are in the camera frame: x right, y up, z toward the viewer. Arrays are [row, column].

    Raises
    ------
    SceneError
        By verbs and properties: the input is at fault, or what is asked for cannot be had of this session.
    """

    def __init__(self, steps: SessionSteps) -> None:
        self._steps = steps

    @property
    def path(self) -> Path:
        """The session's folder, or its session.toml."""
        return self._steps.path

    @property
    def out(self) -> Path:
        """The output folder."""
        return self._steps.out

    # The steps.

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
        """Render the registered scan, and solve the rendering by the same methods; `solving` as in `solve`."""
        return self._run("twin", solving, twin)

    def compare(self, solving: Method = None, twin: TwinSettings | None = None) -> "Session":
        """Go the whole way, compare all with the truth, and write report.html; `solving` as in `solve`."""
        return self._run("compare", solving, twin)

    def _run(self, wanted: str, solving: Method = None, twin: TwinSettings | None = None) -> "Session":
        self._steps.run(wanted, solving, twin)
        return self

    process = compare

    # What they found.

    @property
    def summary(self) -> dict[str, Any]:
        """summary.json: every number so far, units in the key names. Runs `check` where nothing is done yet."""
        return self._steps.told or self.check()._steps.told

    @property
    def warnings(self) -> "Table":
        """What is suspicious so far, with the step that says it."""
        from rgbn.result_tables import Table

        rows = self.summary["warnings"]
        return Table(rows, f"{len(rows)} warning{'s' * (len(rows) != 1)}")

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods whose results are there."""
        return tuple((self._steps.told.get("solve") or {}).get("methods") or ())

    @property
    def store(self) -> Store:
        """Every file of the output folder, as it is."""
        return Store(self.out)

    @property
    def frames(self) -> "Frames":
        """The photographs, linear, memory-mapped. Runs `check`."""
        self._steps.need("check")
        return self.store.load_frames()

    @property
    def camera(self) -> "Camera":
        """The camera; once the balls are found, as they corrected it. Runs `check`."""
        self._steps.need("check")
        return (self.store if self._steps.is_current("calibrate") else self._steps.early).load_camera()

    @property
    def spheres(self) -> "Balls":
        """The calibration balls that were found. Runs `calibrate`."""
        from rgbn.result_tables import Balls

        self._steps.need("calibrate")
        return Balls(self.store.load_spheres(), self.camera, self.store.load_frames())

    @property
    def lights(self) -> "Lights":
        """The flashes: directions (F, 3), positions_mm (F, 3), intensities (F, 3), sigmas. Runs `calibrate`.

        Directions and intensities hold at `reference_point_mm`: amid the balls, and once `align` is done at the
        object's centre.
        """
        self._steps.need("calibrate")
        return (self.store if self._steps.is_current("align") else self._steps.early).load_lights()

    @property
    def mask(self) -> "NDArray[np.bool_]":
        """The object's pixels, (H, W). Runs `align`."""
        self._steps.need("align")
        return self.store.load_mask()

    @property
    def pose(self) -> "Pose":
        """The scan's pose, camera from scan, mm. Runs `align`."""
        session = self._steps.session
        if session.normals or not session.scan:
            why = "gives its normals, so no scan is registered" if session.normals else "names no scan"
            raise self._lacks("pose", why, 'Give [object] scan = "...", and no normals')
        self._steps.need("align")
        return self.store.load_pose()

    @property
    def truth(self) -> "NDArray[np.float32]":
        """Ground-truth normals, (H, W, 3), unit, NaN where unknown. Runs `align`."""
        self._require_truth("ground truth")
        self._steps.need("align")
        return self.store.load_normals("truth")

    def normals(self, method: str, *, twin: bool = False) -> "NDArray[np.float32]":
        """Return a method's normals, (H, W, 3), unit, NaN where unknown; of the twin if asked. Runs `solve`, `twin`."""
        store, name = self._solved(method, twin)
        return store.load_normals(name)

    def albedo(self, method: str, *, twin: bool = False) -> "NDArray[np.float32]":
        """Return a method's albedo, (H, W, 3), RGB, relative, NaN where unknown. Runs `solve`, `twin`."""
        store, name = self._solved(method, twin)
        return store.read_array("albedo", f"{name}.npy")

    def estimate(self, method: str, *, twin: bool = False) -> "Estimate":
        """Return all that a method found, with its own sigma and warnings. Runs `solve`, `twin`."""
        store, name = self._solved(method, twin)
        row = {} if twin else self._steps.told["solve"]["methods"][name]
        told = {key: row[key] for key in ("seconds", "settings") if key in row}
        return store.load_estimate(name, **told, warnings=tuple(row.get("warnings") or ()))

    def error_deg(self, method: str, *, twin: bool = False) -> "NDArray[np.float32]":
        """Return the angle between a method's normals and the truth, (H, W) degrees, NaN where unknown. Needs both."""
        from scene.normals import angular_error_deg

        truth = self.truth
        return angular_error_deg(self.normals(method, twin=twin), truth).astype("float32")

    @property
    def errors(self) -> "Errors":
        """The methods' angular errors, on the photographs and on the twin. Runs `compare`."""
        from rgbn.result_tables import Errors

        self._require_truth("error")
        self._steps.need("compare")
        return Errors(self._steps.told["compare"])

    @property
    def report(self) -> Path:
        """report.html. Runs `compare`."""
        if not (self._steps.is_current("compare") and (self.out / "report.html").is_file()):
            self.compare()
        return self.out / "report.html"

    def __repr__(self) -> str:
        done = ", ".join(self._steps.told.get("seconds") or ()) or "nothing"
        return f"session {self.path}\noutput  {self.out}; done: {done}"

    def _repr_html_(self) -> str:
        from scene.notebook import table_html

        rows = [{"step": name, "seconds": spent} for name, spent in (self._steps.told.get("seconds") or {}).items()]
        return table_html(rows, repr(self))

    def _solved(self, method: str, twin: bool) -> tuple[Store, str]:
        """Return where a method's results lie and its name, after they are made where they are not there."""
        name = self._steps.name_of(method)
        if not twin:
            self._steps.need("solve", name)
            return self.store, name
        if not self._steps.session.scan:
            raise self._lacks("twin", "names no scan", 'Give [object] scan = "..."')
        self._steps.need("twin", name)
        return Store(self.out / "twin"), name

    def _require_truth(self, what: str) -> None:
        session = self._steps.session
        if not (session.scan or session.normals):
            cure = 'Give [object] scan = "...", or normals = "..." that fit the photographs'
            raise self._lacks(what, "names neither a scan nor normals", cure)

    def _lacks(self, what: str, why: str, cure: str) -> SceneError:
        return SceneError(f"{self.path}: there is no {what}: session.toml {why}. {cure}.")


def open_session(
    path: str | Path,
    *,
    out: str | Path | None = None,
    scheduler: str | None = None,
    truth: str | Path | None = None,
    refine_lights: bool | None = None,
) -> Session:
    """Open a session, or the output folder of one; nothing runs yet.

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
    refine_lights : bool, optional
        Let the registered scan's own shading correct lights that it contradicts. Default: as the output folder was
        made; not in a new one.

    Returns
    -------
    Session

    Raises
    ------
    SceneError
        The session cannot be read; every fault at once.

    Examples
    --------
    >>> import rgbn
    >>> s = rgbn.open("captures/penguin")
    >>> s.lights.to_dataframe()
    >>> s.normals("iterative")
    """
    from capture.session.session import load_session

    session, folder = session_and_out(Path(path), None if out is None else Path(out))
    load_session(session)
    said = Settings(refine_lights=refine_lights, truth=None if truth is None else Path(truth).resolve())
    return Session(SessionSteps(session, folder.resolve(), scheduler, said))
