"""From the camera's RGB to colours: the matrix of a session's albedo, and what its values mean."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from formats.picture_files import LUMINANCE
from lab.job import Job

NEUTRAL = 0.8, 1.25
"""Red and blue of a white ball, of its green: matte balls are yellowish by less."""


class Colours(NamedTuple):
    """The matrix (3, 3) of an albedo, which colours it makes, what a value of 1 is; source: "chart", "camera", None."""

    matrix: NDArray[np.float64]
    source: str | None
    colour: str
    one: str
    warnings: tuple[str, ...] = ()


def albedo_colours(job: Job) -> Colours:
    """Return how a session's albedo becomes colours.

    A chart's matrix M holds for its light: one that stood in a flash frame of intensity e (3,) gives M diag(e) for the
    albedo, which is under intensity 1; one that was photographed apart is taken to be lit as the frames on average.
    The camera's own matrix wants white to be known: it is the white ball's. The ball's luminance becomes its stated
    reflectance, or 1; without a ball the neutral colour of green value 1 has luminance 1.
    """
    lights, known = job.store.load_lights(), job.done.get("check", {}).get("result", {}).get("colour", {})
    ball, source = lights.white_value, known.get("source")
    own = np.array(known.get("camera_to_srgb") or np.eye(3), float)
    of_ball = "" if ball is None else ", white as the white ball"
    matrix = np.eye(3) if ball is None else np.diag(1 / ball)
    if source == "chart":
        flash, missed = known["flash"], known["delta_e_2000"]
        matrix = own if flash is None else own * np.nan_to_num(lights.intensities[flash], nan=1.0)
        missed = f"median {missed['median']:.1f}, worst {missed['worst']:.1f}"
        colour = f"linear sRGB (D65), by the ColorChecker; Delta E 2000 of its patches: {missed}"
    elif source == "camera" and ball is not None:
        matrix, colour = own @ matrix, f"linear sRGB (D65), by the camera's own matrix{of_ball}"
    else:
        source, colour = None, f"the camera's own RGB, linear{of_ball}"
    if ball is None:
        neutral = np.linalg.solve(matrix, np.ones(3))
        return Colours(matrix * neutral[1], source, colour, "a pixel value of 1 under a light of intensity 1")
    red, green, blue = shown = matrix @ ball
    is_white = all(NEUTRAL[0] < part / green < NEUTRAL[1] for part in (red, blue))
    warning = (
        f"frames.chart: by the ColorChecker the white ball's red, green and blue are {red / green:.2f} : 1 : "
        f"{blue / green:.2f}, not white. Was the chart lit by the same flash, and by it alone?"
    )
    stated = next((one.reflectance for one in job.session.spheres if one.kind == "white"), None)
    one = "as bright as the white ball" if stated is None else f"all light (the white ball: {stated:g}, as stated)"
    scale = (stated or 1.0) / float(LUMINANCE @ shown)
    return Colours(matrix * scale, source, colour, one, () if is_white else (warning,))
