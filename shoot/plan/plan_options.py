"""What the command line says of a shoot to be planned, as one object that every part of the plan reads."""

from dataclasses import dataclass
from typing import Annotated, Literal

from cyclopts import Parameter
from cyclopts.validators import Number

from scene.length_units import Unit

View = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
FEWEST, MOST = 4, 200
"""Flashes: three tell a normal, and nothing whether it is right."""


def _number(what: str, **limits: float) -> Parameter:
    return Parameter(help=what, negative="", validator=Number(**limits) if limits else None)


@Parameter(name="*")
@dataclass(frozen=True)
class PlanOptions:
    """Flashes and balls; object and camera where no session or scan tells them. Each field's help says what it is."""

    flashes: Annotated[int, _number("How many flashes in all, with those that there are.", gte=FEWEST, lte=MOST)] = 24
    unit: Annotated[Unit | None, Parameter(help="Unit of the scan. A scan needs it.")] = None
    seen_from: Annotated[
        View,
        Parameter(help="Axis of the scan that points to the camera. Up is z, or y where z points there."),
    ] = "+z"
    size_mm: Annotated[float, _number("Diameter of the sphere that stands for an object without a scan.", gt=0)] = 150.0
    albedo: Annotated[
        float,
        _number("Share of the light that the object reflects: white 0.8, wood 0.4, dark things 0.1.", gt=0, lte=1),
    ] = 0.5
    focal_mm: Annotated[float, _number("Focal length of the lens, mm.", gt=0)] = 50.0
    sensor_mm: Annotated[float, _number("Width of the sensor, mm; 36 for full frame, 23.5 for APS-C.", gt=0)] = 36.0
    pixels: Annotated[tuple[int, int], _number("Width and height of the picture, pixels.", gt=0)] = (6000, 4000)
    distance_mm: Annotated[
        float | None,
        _number(
            "Distance from the camera to the object's middle. Default: the object fills 40 % of the picture.", gt=0
        ),
    ] = None
    iso: Annotated[float, _number("ISO, for the noise of a usual sensor.", gt=0)] = 100.0
    from_deg: Annotated[float, _number("Least angle of a flash from the camera's axis.", gte=0, lt=90)] = 12.0
    to_deg: Annotated[
        float, _number("Greatest angle of a flash from that axis. For a ring it equals --from-deg.", gt=0, lt=90)
    ] = 60.0
    flash_mm: Annotated[
        float | None,
        _number(
            "Distance from the flash to the object's middle. Default: five times its size, and 700 mm at least.", gt=0
        ),
    ] = None
    azimuths_deg: Annotated[
        tuple[float, float],
        _number("Range around the axis that you can reach. 0 is right, 90 is up."),
    ] = (0.0, 360.0)
    ball_mm: Annotated[
        float | None,
        _number(
            "Diameter of the balls, three of chrome and a white one, mm. Default: 20 or more, by 60 px of radius.", gt=0
        ),
    ] = None


AS_USUAL = PlanOptions()
