"""`import rgbn`: a session opened in Python, its steps as methods, what they found as the house's own types."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lab.options import AS_GIVEN, Solving, TwinSettings
from lab.run import run_session

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from scene.camera import Camera
    from scene.frames import Frames
    from scene.lights import Lights
    from scene.pose import Pose
    from scene.spheres import Sphere
    from scene.store import Store


@dataclass(frozen=True)
class Results:
    """What a session's steps found: the output folder, read when it is asked for.

    Parameters
    ----------
    folder : Path
    summary : dict
        summary.json: every number of the report, units in the key names.
    """

    folder: Path
    summary: dict[str, Any]

    @property
    def store(self) -> "Store":
        """Every file of the output folder."""
        from scene.store import Store

        return Store(self.folder)

    @property
    def frames(self) -> "Frames":
        """The photographs, linear, memory-mapped."""
        return self.store.load_frames()

    @property
    def camera(self) -> "Camera":
        """The camera, as the balls corrected it."""
        return self.store.load_camera()

    @property
    def spheres(self) -> "list[Sphere]":
        """The calibration balls that were found."""
        return self.store.load_spheres()

    @property
    def lights(self) -> "Lights":
        """The flashes: directions (F, 3), positions_mm, intensities (F, 3), sigmas; camera frame."""
        return self.store.load_lights()

    @property
    def pose(self) -> "Pose":
        """The scan's pose, camera from scan."""
        return self.store.load_pose()

    @property
    def mask(self) -> "NDArray[np.bool_]":
        """The object's pixels, (H, W)."""
        return self.store.load_mask()

    @property
    def truth(self) -> "NDArray[np.float32]":
        """Ground-truth normals, (H, W, 3), unit, camera frame, NaN where unknown."""
        return self.store.load_normals("truth")

    def normals(self, method: str) -> "NDArray[np.float32]":
        """Return a method's normals, (H, W, 3), unit, camera frame, NaN where unknown."""
        return self.store.load_normals(method)

    def albedo(self, method: str) -> "NDArray[np.float32]":
        """Return a method's albedo, (H, W, 3), RGB, NaN where unknown."""
        return self.store.read_array("albedo", f"{method}.npy")


@dataclass(frozen=True)
class SessionRun:
    """A session and its output folder. Each verb runs what is not done and current yet, as the command line does.

    Every verb returns `Results` and raises `scene.errors.SceneError` where the input is at fault.

    Parameters
    ----------
    path, out : Path
        The session's folder and the output folder.
    scheduler : str or None
        Address of a Dask scheduler; None: this machine's cores.
    truth : Path or None
        Folder of a known truth to judge the results by.
    refine_lights : bool
        Let the registered scan's own shading correct lights that it contradicts.
    """

    path: Path
    out: Path
    scheduler: str | None = None
    truth: Path | None = None
    refine_lights: bool = False

    def _run(self, wanted: str, solving: Solving | str | None = None, twin: TwinSettings = AS_GIVEN) -> Results:
        solving = solving if isinstance(solving, Solving) else Solving(solving)
        how = {"scheduler": self.scheduler, "truth": self.truth, "refine_lights": self.refine_lights}
        how |= {"solving": solving, "twin": twin}
        return Results(self.out, run_session(self.path, wanted, out=self.out, **how))

    def check(self) -> Results:
        """Decode the capture and audit it."""
        return self._run("check")

    def calibrate(self) -> Results:
        """Find the balls, and from them the lights."""
        return self._run("calibrate")

    def align(self) -> Results:
        """Find the object, register its scan, write the ground truth."""
        return self._run("align")

    def solve(self, solving: Solving | str | None = None) -> Results:
        """Recover normals and albedo; `solving` names methods, with commas, or says more of them."""
        return self._run("solve", solving)

    def twin(self, solving: Solving | str | None = None, twin: TwinSettings = AS_GIVEN) -> Results:
        """Render the registered scan, and solve the rendering by the same methods."""
        return self._run("twin", solving, twin)

    def compare(self, solving: Solving | str | None = None, twin: TwinSettings = AS_GIVEN) -> Results:
        """Go the whole way, compare all with the truth, and write report.html."""
        return self._run("compare", solving, twin)

    process = compare


def open_session(
    path: str | Path,
    *,
    out: str | Path | None = None,
    scheduler: str | None = None,
    truth: str | Path | None = None,
    refine_lights: bool = False,
) -> SessionRun:
    """Open a session's folder; nothing runs yet.

    Parameters
    ----------
    path : str or Path
        Folder with session.toml, or in the DiLiGenT layout.
    out : str or Path, optional
        Output folder: new, empty or rgbn's own. Default: out/NAME here, by the session's name.
    scheduler : str, optional
        Address of a Dask scheduler.
    truth : str or Path, optional
        Folder of a known truth (truth.json, truth.npz) to judge the results by.
    refine_lights : bool
        Let the registered scan's own shading correct lights that it contradicts.

    Raises
    ------
    SceneError
        The session cannot be read; every fault at once.
    """
    from capture.session.session import load_session

    session = load_session(Path(path))
    folder = Path(out) if out is not None else Path("out") / session.name
    return SessionRun(Path(path), folder, scheduler, None if truth is None else Path(truth), refine_lights)
