"""Wrong axes in words: what they are, and what to do about them."""

import numpy as np
from numpy.typing import NDArray

from solve.axes import Axes

Array = NDArray[np.float64]
_WORDS = {
    "(-x, y, z)": "x points left",
    "(x, -y, z)": "y points down",
    "(x, y, -z)": "z points away from the viewer",
    "(x, -y, -z)": "y points down and z away from the viewer (OpenCV's frame)",
    "(-x, -y, z)": "x points left and y down",
    "(-x, y, -z)": "x points left and z away from the viewer",
    "(-x, -y, -z)": "all three point the other way",
    "(y, x, z)": "x and y are swapped",
}


def lights_fault(turn: Array, given: float, best: float, *, certain: bool, normals_name: str) -> str:
    """Return what to say of light directions that `turn` (3, 3) mends.

    given, best: agreement of the photographs with Lambert's law, as given and mended. certain: the normals tell that it
    is not they.
    """
    words = _what(turn)
    if words == "all three point the other way":
        words = "they go from the light to the surface"
    or_else = "" if certain and not _is_half_turn(turn) else (
        f" Or {normals_name} is in other axes: the photographs tell that the two differ."
    )  # fmt: skip
    return (
        f"light_directions.txt: {words}; expected x right, y up, z toward the viewer, from the surface to the light "
        f"(agreement {given:.2f}, put right {best:.2f}). {_do(turn, 'columns')}{or_else}"
    )


def normals_fault(name: str, turn: Array, given: float, best: float) -> str:
    """Return what to say of a normal map that `turn` (3, 3) mends."""
    return (
        f"{name}: {_what(turn)}; expected x right, y up, z toward the viewer (by the map's own slopes and rim; "
        f"agreement {given:.2f}, put right {best:.2f}). {_do(turn, 'components')}"
    )


def _what(turn: Array) -> str:
    return _WORDS.get(str(Axes(turn)), "the axes are permuted")


def _do(turn: Array, things: str) -> str:
    flips = [axis for axis in range(3) if turn[axis, axis] == -1]
    if np.count_nonzero(np.diag(turn)) == 3:
        if len(flips) == 3:
            return f"Change the sign of all {things}."
        which = " and ".join(("first", "second", "third")[axis] for axis in flips)
        return f"Change the sign of the {which} of the {things}."
    return f"Of {things} (x, y, z) write {Axes(turn)}."


def _is_half_turn(turn: Array) -> bool:
    """Whether x and y change sign, which a hollow looks like."""
    return np.array_equal(turn, np.diag([-1.0, -1.0, 1.0]))
