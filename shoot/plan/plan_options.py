"""What the command line says of a shoot to be planned, as three objects."""

from dataclasses import dataclass
from typing import Annotated, Literal

from cyclopts import Parameter

from scene.errors import SceneError
from scene.length_units import Unit

Layout = Literal["dome", "ring", "free"]
Gloss = Literal["matte", "satin", "semi-gloss", "gloss"]
View = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
FEWEST, MOST = 4, 200
"""Flashes: three tell a normal, and nothing whether it is right."""


@Parameter(name="*")
@dataclass(frozen=True)
class ObjectOptions:
    """What is photographed, where neither a session nor its scan tells."""

    unit: Annotated[Unit | None, Parameter(help="Unit of the scan's numbers; needed with a scan.")] = None
    seen_from: Annotated[
        View,
        Parameter(help="The scan's axis that points to the camera. Up in the picture is z, or y if z points there."),
    ] = "+z"
    shape: Annotated[Literal["sphere", "relief"], Parameter(help="Stands for the object where there is no scan.")] = (
        "sphere"
    )
    size_mm: Annotated[float, Parameter(help="Its size across.")] = 150.0
    gloss: Annotated[
        Gloss,
        Parameter(
            help="matte: plaster, stone, paper. satin: wax, skin, worn wood. semi-gloss: eggshell, paint. gloss: "
            "glaze, varnish. What is glossier (metal, glass, polish) no method here can tell."
        ),
    ] = "matte"
    albedo: Annotated[
        float, Parameter(help="Share of the light that it gives back: white 0.8, wood 0.4, dark 0.1.")
    ] = 0.5

    def check(self) -> None:
        """Raise SceneError for what no object is."""
        if not self.size_mm > 0:
            raise SceneError(f"--size-mm {self.size_mm:g}: expected a length above 0.")
        if not 0 < self.albedo <= 1:
            raise SceneError(f"--albedo {self.albedo:g}: expected above 0, 1 at most.")


@Parameter(name="*")
@dataclass(frozen=True)
class CameraOptions:
    """The camera, where no session tells."""

    focal_mm: Annotated[float, Parameter(help="Focal length of the lens.")] = 50.0
    sensor_mm: Annotated[float, Parameter(help="Width of its sensor: 36 for full frame, 23.5 for APS-C.")] = 36.0
    pixels: Annotated[tuple[int, int], Parameter(help="Width and height of its picture.")] = (6000, 4000)
    distance_mm: Annotated[
        float | None,
        Parameter(help="From the camera to the object's middle. Default: the object fills 40 % of the picture."),
    ] = None
    iso: Annotated[float, Parameter(help="Noise as of a usual sensor at this ISO.")] = 100.0

    def check(self) -> None:
        """Raise SceneError for what no camera is."""
        lengths = {"focal-mm": self.focal_mm, "sensor-mm": self.sensor_mm, "distance-mm": self.distance_mm or 1.0}
        for name, value in (lengths | {"iso": self.iso, "pixels": float(min(self.pixels))}).items():
            if not value > 0:
                raise SceneError(f"--{name} {value:g}: expected a number above 0.")


@Parameter(name="*")
@dataclass(frozen=True)
class ShootOptions:
    """Flashes and balls."""

    layout: Annotated[
        Layout, Parameter(help="free: carried by hand, anywhere in reach. dome: lamps over a cap. ring: at --to-deg.")
    ] = "free"
    from_deg: Annotated[float, Parameter(help="Flashes from so many degrees beside the camera's axis on.")] = 12.0
    to_deg: Annotated[float, Parameter(help="To so many degrees.")] = 60.0
    flash_mm: Annotated[
        float | None,
        Parameter(help="From the flash to the object's middle. Default: five times its size, 700 at least."),
    ] = None
    azimuths_deg: Annotated[
        tuple[float, float],
        Parameter(help="From where to where around the axis one can go: 0 right, 90 up, as the camera sees it."),
    ] = (0.0, 360.0)
    chrome: Annotated[
        tuple[float, ...],
        Parameter(
            help="Diameters of the chrome balls that there are, mm. Default: what the accuracy needs.", negative=""
        ),
    ] = ()
    white: Annotated[
        tuple[float, ...],
        Parameter(help="Diameters of the white balls, mm. Default: one like the chrome.", negative=""),
    ] = ()
    accuracy_deg: Annotated[
        float | None,
        Parameter(help="Wanted median error of the normals: the plan ends with the flash that reaches it."),
    ] = None

    def check(self, flashes: int) -> None:
        """Raise SceneError for what cannot be planned."""
        if not FEWEST <= flashes <= MOST:
            raise SceneError(
                f"--flashes {flashes}: expected {FEWEST} to {MOST}. Three tell a normal only where none is in shadow, "
                "and the fourth whether it is right."
            )
        for name, some in (("chrome", self.chrome), ("white", self.white)):
            if not all(value > 0 for value in some):
                raise SceneError(f"--{name} {' '.join(f'{value:g}' for value in some)}: expected diameters above 0 mm.")
        if self.accuracy_deg is not None and not 0 < self.accuracy_deg < 90:
            raise SceneError(f"--accuracy-deg {self.accuracy_deg:g}: expected between 0 and 90 degrees.")
