"""What the command line says of a shoot to be planned, as one object that every part of the plan reads."""

from dataclasses import dataclass
from typing import Annotated, Literal

from cyclopts import Parameter
from cyclopts.types import PositiveFloat, PositiveInt
from cyclopts.validators import Number

from scene.length_units import Unit

View = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
FEWEST, MOST = 4, 200
"""Flashes: three tell a normal, and nothing whether it is right."""


@Parameter(name="*")
@dataclass(frozen=True)
class PlanOptions:
    """Flashes and balls; object and camera where no session or scan tells them. The help is what stands below each."""

    flashes: Annotated[int, Parameter(validator=Number(gte=FEWEST, lte=MOST))] = 24
    """How many flashes in all, with those that there are."""
    unit: Unit | None = None
    """Unit of the scan. A scan needs it."""
    seen_from: View = "+z"
    """Axis of the scan that points to the camera. Up is z, or y where z points there."""
    size_mm: PositiveFloat = 150.0
    """Diameter of the sphere that stands for an object without a scan."""
    albedo: Annotated[float, Parameter(validator=Number(gt=0, lte=1))] = 0.5
    """Share of the light that the object reflects: white 0.8, wood 0.4, dark things 0.1."""
    focal_mm: PositiveFloat = 50.0
    """Focal length of the lens, mm."""
    sensor_mm: PositiveFloat = 36.0
    """Width of the sensor, mm; 36 for full frame, 23.5 for APS-C."""
    pixels: tuple[PositiveInt, PositiveInt] = (6000, 4000)
    """Width and height of the picture, pixels."""
    from_deg: Annotated[float, Parameter(validator=Number(gte=0, lt=90))] = 12.0
    """Least angle of a flash from the camera's axis."""
    to_deg: Annotated[float, Parameter(validator=Number(gt=0, lt=90))] = 60.0
    """Greatest angle of a flash from that axis. For a ring it equals --from-deg."""
    flash_mm: PositiveFloat | None = None
    """Distance from the flash to the object's middle. Default: five times its size, and 700 mm at least."""
    azimuths_deg: tuple[float, float] = (0.0, 360.0)
    """Range around the axis that you can reach. 0 is right, 90 is up."""
    ball_mm: PositiveFloat | None = None
    """Diameter of the balls, three of chrome and a white one, mm. Default: 20 or more, by 60 px of radius."""


AS_USUAL = PlanOptions()
