"""Known lights that a ball contradicts: which mistake with axes or order would explain it."""

import numpy as np
from numpy.typing import NDArray

from scene.normals import angular_error_deg

Array = NDArray[np.float64]
SUSPICIOUS_DEG = 20.0
"""Median angle between known and seen directions that nothing honest explains: flashes a metre away, taken as distant,
are 10 to 15 degrees elsewhere for a ball that stands 200 mm beside the object."""
TURNS = {
    "with y flipped: is the file y-down?": np.diag([1.0, -1.0, 1.0]),
    "with y and z flipped: is the file in OpenCV's frame?": np.diag([1.0, -1.0, -1.0]),
    "with z flipped: is the file z-away?": np.diag([1.0, 1.0, -1.0]),
    "with x flipped: are the photographs mirrored?": np.diag([-1.0, 1.0, 1.0]),
    "with x and y flipped: are the photographs upside down, or the vectors away from the lights?": np.diag(
        [-1.0, -1.0, 1.0]
    ),
    "with every sign flipped: do the vectors point away from the lights?": -np.eye(3),
    "with x and y exchanged": np.eye(3)[[1, 0, 2]],
    "with y and z exchanged: is the file y-up?": np.eye(3)[[0, 2, 1]],
    "turned by 90 degrees to the left: were the photographs turned?": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "turned by 90 degrees to the right: were the photographs turned?": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
}


def contradiction(witness: str, names: tuple[str, ...], seen: Array, known: Array) -> str | None:
    """Say what is wrong with known light directions, if a witness sees them elsewhere.

    Parameters
    ----------
    witness : str
        Who saw, for the message: "chrome ball 1".
    names : tuple of F str
        The frames'.
    seen, known : (F, 3) float64
        Unit; rows of `seen` are NaN where the witness saw nothing.

    Returns
    -------
    warning : str or None
        None where they agree to 20 degrees (median), and no frame is farther off than that from the median.
    """
    use = np.isfinite(seen).all(1) & np.isfinite(known).all(1)
    if use.sum() < 3:
        return None
    each = angular_error_deg(seen, known)
    off = float(np.median(each[use]))
    if off < SUSPICIOUS_DEG:
        return _odd_frames(witness, names, seen, known, np.flatnonzero(use & (each > off + SUSPICIOUS_DEG)))
    told = f"lights.file: {witness} sees its lights {off:.0f} degrees off (median)"
    trials = [(words, known @ turn.T) for words, turn in TURNS.items()]
    trials += [
        (f"{k} frames later: are they of these photographs?", np.roll(known, k, 0)) for k in range(1, len(known))
    ]
    trials += [("in reverse order: is the file sorted otherwise?", known[::-1])]
    words, better = min(
        ((words, float(np.nanmedian(angular_error_deg(seen[use], trial[use])))) for words, trial in trials),
        key=lambda item: item[1],
    )
    if better < min(off / 2, 18.0):
        return f"{told}, but only {better:.1f} degrees {words} Correct lights.file; it is used as it stands."
    return (
        f"{told}, and no flip or roll explains it: the lights do not belong to these photographs, or their order is "
        "lost. Correct lights.file; it is used as it stands."
    )


def _odd_frames(witness: str, names: tuple[str, ...], seen: Array, known: Array, odd: NDArray[np.intp]) -> str | None:
    """Name the few frames whose lights are another's."""
    if not len(odd):
        return None
    listed = ", ".join(names[f] for f in odd)
    exchanged = known.copy()
    exchanged[odd] = known[odd[::-1]]
    told = f"lights.file: {witness} sees the light of {listed} elsewhere (more than {SUSPICIOUS_DEG:.0f} degrees off)"
    if len(odd) == 2 and angular_error_deg(seen[odd], exchanged[odd]).max() < SUSPICIOUS_DEG:
        return (
            f"{told}, and each where the other's should be: exchanged. Correct lights.file, or the photographs' names."
        )
    return f"{told}. Is another thing's reflection taken for the flash there, or is the file's order wrong?"
