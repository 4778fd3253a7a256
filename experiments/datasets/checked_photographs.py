"""A dataset's photographs, one after the other: their faults, and what some of the object's pixels show in each."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formats.diligent_layout import Layout
from formats.pictures import read_values
from scene.errors import SceneError
from scene.reading import listed
from solve.convention import CLIPPED

MOST_PIXELS = 1600
_MUCH_CLIPPED = 0.3
_DARKER = 1.0


@dataclass(frozen=True)
class Samples:
    """Some of the object's pixels."""

    places: NDArray[np.intp]  # (P,) in the picture, row by row
    values: NDArray[np.float32]  # (P, N, 3) 0 to 1, as they stand in the files


def read_samples(found: Layout) -> Samples | None:
    """Read the photographs, and append to the layout's faults and notes what is wrong with them.

    None where there is no mask, or a photograph is at fault.
    """
    size = None if found.mask is None else found.mask.shape
    places = np.zeros(0, np.intp)
    if found.mask is not None:
        inside = np.flatnonzero(found.mask)
        places = inside[np.unique(np.linspace(0, len(inside) - 1, min(MOST_PIXELS, len(inside))).astype(int))]
    values = np.zeros((len(places), len(found.files), 3), np.float32)
    faults, shallow, dark, clipped, within, around = [], [], [], [], 0.0, 0.0
    for index, name in enumerate(found.files):
        try:
            image, white = read_values(found.folder / name, SceneError, do="Save it as a 16-bit PNG.")
        except SceneError as error:
            faults.append(str(error).removeprefix(f"{found.folder}/"))
            continue
        size = size or image.shape[:2]
        if image.shape[:2] != size:
            faults.append(
                f"{name}: {image.shape[1]} x {image.shape[0]} px, expected {size[1]} x {size[0]} px, the size of "
                f"{'mask.png' if found.mask is not None else found.files[0]}."
            )
            continue
        if image.dtype not in (np.uint8, np.uint16):
            faults.append(f"{name}: holds {image.dtype}, expected whole numbers of 16 bits. Save it as a 16-bit PNG.")
            continue
        if image.dtype == np.uint8:
            shallow.append(name)
        colours = image if image.ndim == 3 else np.repeat(image[..., None], 3, -1)
        if found.mask is None:
            continue
        scaled = colours.reshape(-1, colours.shape[2])[:, :3].astype(np.float32) / white
        values[:, index] = scaled[places]
        flat = found.mask.ravel()
        within, around = within + float(scaled[flat].mean()), around + float(scaled[~flat].mean())
        if not scaled[flat].any():
            dark.append(name)
        if (values[:, index].max(-1) >= CLIPPED).mean() > _MUCH_CLIPPED:
            clipped.append(name)
    found.faults += faults
    _tell(found, shallow, dark, clipped, within, around)
    return None if faults or found.mask is None or not found.files else Samples(places, values)


def _tell(found: Layout, shallow: list, dark: list, clipped: list, within: float, around: float) -> None:
    if shallow:
        found.notes.append(f"{listed(shallow)}: 8 bits, expected 16. Dark places have few steps; save 16-bit PNGs.")
    if dark:
        found.faults.append(
            f"{listed(dark)}: black all over the object. The flash did not fire? Take it off the lists."
        )
    if clipped:
        found.notes.append(f"{listed(clipped)}: more than {_MUCH_CLIPPED:.0%} of the object is clipped. Expose less.")
    if around > _DARKER * within > 0:
        found.notes.append(
            f"mask.png: the photographs are brighter outside it ({around / len(found.files):.3f}) than inside "
            f"({within / len(found.files):.3f} of white). White must be the object."
        )
