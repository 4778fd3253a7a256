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
    "turned by 90 degrees to the left: were the photographs turned?": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "turned by 90 degrees to the right: were the photographs turned?": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
}


def contradiction(witness: str, seen: Array, known: Array) -> str | None:
    """Say what is wrong with known light directions, if a witness sees them elsewhere.

    Parameters
    ----------
    witness : str
        Who saw, for the message: "chrome ball 1".
    seen, known : (F, 3) float64
        Unit; rows of `seen` are NaN where the witness saw nothing.

    Returns
    -------
    warning : str or None
        None where they agree to 20 degrees (median).
    """
    use = np.isfinite(seen).all(1) & np.isfinite(known).all(1)
    if use.sum() < 3:
        return None
    off = float(np.median(angular_error_deg(seen[use], known[use])))
    if off < SUSPICIOUS_DEG:
        return None
    told = f"{witness} sees the known lights {off:.0f} degrees off (median)"
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
        f"{told}, and no flip or other order explains it: is it the file of these photographs? It is used as it stands."
    )
