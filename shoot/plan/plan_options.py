"""What the command line says of a shoot to be planned, as one object that every part of the plan reads."""

from dataclasses import dataclass
from typing import Annotated, Literal

from cyclopts import Parameter
from cyclopts.validators import Number

from scene.length_units import Unit
from shoot.init.answers import diameters

Layout = Literal["dome", "ring", "free"]
Gloss = Literal["matte", "satin", "semi-gloss", "gloss"]
View = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
FEWEST, MOST = 4, 200
"""Flashes: three tell a normal, and nothing whether it is right."""
POSITIVE = Number(gt=0)


@Parameter(name="*")
@dataclass(frozen=True)
class PlanOptions:
    """Flashes and balls; object and camera where no session or scan tells them. Each field's help says what it is."""

    flashes: Annotated[
        int,
        Parameter(
            help="How many flashes, those that there are already included.", validator=Number(gte=FEWEST, lte=MOST)
        ),
    ] = 24
    unit: Annotated[Unit | None, Parameter(help="Unit of the scan's numbers; needed with a scan.")] = None
    seen_from: Annotated[
        View,
        Parameter(help="The scan's axis that points to the camera. Up in the picture is z, or y if z points there."),
    ] = "+z"
    shape: Annotated[Literal["sphere", "relief"], Parameter(help="Stands for the object where there is no scan.")] = (
        "sphere"
    )
    size_mm: Annotated[float, Parameter(help="Its size across.", validator=POSITIVE)] = 150.0
    gloss: Annotated[
        Gloss,
        Parameter(
            help="matte: plaster, stone, paper. satin: wax, skin, worn wood. semi-gloss: eggshell, paint. gloss: "
            "glaze, varnish. What is glossier (metal, glass, polish) no method here can tell."
        ),
    ] = "matte"
    albedo: Annotated[
        float,
        Parameter(
            help="Share of the light that it gives back: white 0.8, wood 0.4, dark 0.1.", validator=Number(gt=0, lte=1)
        ),
    ] = 0.5
    focal_mm: Annotated[float, Parameter(help="Focal length of the lens.", validator=POSITIVE)] = 50.0
    sensor_mm: Annotated[
        float, Parameter(help="Width of its sensor: 36 for full frame, 23.5 for APS-C.", validator=POSITIVE)
    ] = 36.0
    pixels: Annotated[
        tuple[int, int], Parameter(help="Width and height of its picture.", negative="", validator=POSITIVE)
    ] = (6000, 4000)
    distance_mm: Annotated[
        float | None,
        Parameter(
            help="From the camera to the object's middle. Default: the object fills 40 % of the picture.",
            validator=POSITIVE,
        ),
    ] = None
    iso: Annotated[float, Parameter(help="Noise as of a usual sensor at this ISO.", validator=POSITIVE)] = 100.0
    layout: Annotated[
        Layout, Parameter(help="free: carried by hand, anywhere in reach. dome: lamps over a cap. ring: at --to-deg.")
    ] = "free"
    from_deg: Annotated[
        float,
        Parameter(help="Flashes from so many degrees beside the camera's axis on.", validator=Number(gte=0, lt=90)),
    ] = 12.0
    to_deg: Annotated[float, Parameter(help="To so many degrees.", validator=Number(gt=0, lt=90))] = 60.0
    flash_mm: Annotated[
        float | None,
        Parameter(
            help="From the flash to the object's middle. Default: five times its size, 700 at least.",
            validator=POSITIVE,
        ),
    ] = None
    azimuths_deg: Annotated[
        tuple[float, float],
        Parameter(
            help="From where to where around the axis one can go: 0 right, 90 up, as the camera sees it.", negative=""
        ),
    ] = (0.0, 360.0)
    chrome: Annotated[
        tuple[float, ...],
        diameters("Diameters of the chrome balls that there are, mm. Default: what the accuracy needs."),
    ] = ()
    white: Annotated[
        tuple[float, ...], diameters("Diameters of the white balls, mm. Default: one like the chrome.")
    ] = ()
    accuracy_deg: Annotated[
        float | None,
        Parameter(
            help="Wanted median error of the normals: the plan ends with the flash that reaches it.",
            validator=Number(gt=0, lt=90),
        ),
    ] = None


AS_USUAL = PlanOptions()
