"""`rgbn init` as the command line has it."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from scene.errors import SceneError
from scene.length_units import Unit

if TYPE_CHECKING:
    from scene.spheres import Kind
    from shoot.init.answers import Answers
    from shoot.init.draft import Draft


@Parameter(name="*")
@dataclass(frozen=True)
class Told:
    """What no photograph tells of a capture, as the command line says it; each field's help says what it is."""

    chrome: Annotated[
        tuple[str, ...],
        Parameter(
            help="Diameter of the chrome balls, mm: one for all, or one for each, largest in the picture first.",
            negative="",
        ),
    ] = ()
    white: Annotated[tuple[str, ...], Parameter(help="Diameter of the white balls, mm.", negative="")] = ()
    unit: Annotated[
        Unit | None,
        Parameter(help="Unit of the scan. Default: told by the object's size in the picture."),
    ] = None
    focal_mm: Annotated[float | None, Parameter(help="Focal length engraved on the lens, mm. Default: EXIF's.")] = None
    sensor_mm: Annotated[float | None, Parameter(help="Width of the sensor, mm: 36 for full frame.")] = None
    pixel_um: Annotated[float | None, Parameter(help="Instead: distance from pixel to pixel, micrometres.")] = None
    crop_factor: Annotated[float | None, Parameter(help="Instead: 1.5 or 1.6 for APS-C, 2 for four thirds.")] = None
    distance_mm: Annotated[
        float | None, Parameter(help="From the camera to the balls, by a tape: it tells the focal length.")
    ] = None
    linear: Annotated[
        bool | None, Parameter(help="Whether values of 8-bit files are proportional to light. Default: asked.")
    ] = None

    def answers(self) -> "Answers":
        """Return it as `shoot.init` takes it.

        Raises
        ------
        SceneError
            A length that is none, or two options that tell the same.
        """
        from capture.session.session_types import Lens
        from shoot.init.answers import Answers, lengths_of

        said = {key: getattr(self, key) for key in ("focal_mm", "sensor_mm", "pixel_um", "crop_factor")}
        sensors = [
            f"--{key.replace('_', '-')}" for key in ("sensor_mm", "pixel_um", "crop_factor") if said[key] is not None
        ]
        for key, value in {**said, "distance_mm": self.distance_mm}.items():
            if value is not None and not 0 < value < 1e5:
                raise SceneError(f"--{key.replace('_', '-')} {value:g}: expected a length above 0.")
        if len(sensors) > 1:
            raise SceneError(f"{', '.join(sensors)}: each tells the size of the sensor. Give one of them.")
        if self.distance_mm is not None and self.focal_mm is not None:
            raise SceneError("--focal-mm, --distance-mm: each tells the focal length. Give one of them.")
        words: dict[Kind, tuple[str, ...]] = {"chrome": self.chrome, "white": self.white}
        diameters: dict[Kind, tuple[float, ...]] = {}
        for kind, some in words.items():
            try:
                diameters |= {kind: lengths_of(" ".join(some))} if some else {}
            except ValueError as error:
                raise SceneError(f"--{kind} {error}.") from None
        return Answers(diameters, self.unit, Lens(**said), self.distance_mm, self.linear)


TOLD = Told()


def init(
    folder: Annotated[Path, Parameter(help="Folder with the photographs; or with a folder of them for each object.")],
    /,
    *,
    yes: Annotated[
        bool, Parameter(name=["--yes", "-y"], help="Ask nothing: what is not known is assumed, and said.", negative="")
    ] = False,
    told: Told = TOLD,
) -> None:
    """Look at a folder of photographs, show what it holds, ask what no file tells, and write its session.toml."""
    from shoot.init.init_session import init_sessions

    answers = told.answers()
    made, _ = init_sessions(folder, answers, silent=yes, shown=_show)
    for one in made:
        print(f"written  {one.manifest}")
        print(f"         {one.sheet}: the balls in circles; look whether all are found")
    print(f"next     rgbn process {made[0].draft.folder}")


def _show(draft: "Draft") -> None:
    """Print what was found, and what was assumed."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from shoot.init.draft_notes import notes_of

    table = Table(title=Text(f"{draft.folder}"), show_header=False, title_justify="left", box=None)
    table.add_column(style="bold")
    table.add_column()
    for label, text in _rows(draft):
        table.add_row(label, Text(text))
    console = Console()
    console.print(table)
    for note in notes_of(draft):
        console.print(Text("note ", style="yellow") + Text(note))


def _rows(draft: "Draft") -> list[tuple[str, str]]:
    rows = []
    for role, files in draft.photographs.items():
        shown = files[0].name if len(files) == 1 else f"{files[0].name} to {files[-1].name}"
        size = f", {draft.width} x {draft.height} px" if role == "flash" else ""
        rows.append((role, f"{len(files)}: {shown}{size}"))
    rows.append(("camera", draft.camera_told))
    told = f": {draft.unit_told}" if draft.unit_told else ""
    for number, ball in enumerate(draft.balls, 1):
        (u, v), diameter = ball.center_px, ball.diameter_mm
        known = f"{diameter:.4g} mm" if diameter else f"diameter not known: --{ball.kind} MM"
        place = f"at ({u:.0f}, {v:.0f}) px, radius {ball.radius_px:.0f} px, " if ball.radius_px else ""
        place = f"{len(ball.files)} photographs of its own, " if ball.files else place
        rows.append((f"ball {number}", f"{ball.kind}, {place}{known}"))
    for label, path, more in (
        ("scan", draft.scan, f", {draft.scan_told}; unit {draft.unit}{told}"),
        ("mask", draft.mask, ""),
        ("lights", draft.lights, ""),
        ("normals", draft.normals, ""),
    ):
        if path:
            rows.append((label, f"{path.name}{more}"))
    return rows
