"""Is the scan as large as the lights have it? One more unknown in the finished registration: a common scale.

The picture does not tell: a larger object farther away looks the same. But near lights reach it otherwise there, and
where they stand is known in the millimetres of the balls' diameters.
"""

from dataclasses import dataclass

import numpy as np

from align.pose.full_resolution import UNMODELLED, FinalEvidence
from align.pose.refine import Term

ROUNDS = 4
STEP = 0.02
"""Of log scale, for its slope."""
SUSPICIOUS, DEVIATIONS = 0.04, 4.0
"""How far from 1 a scale must be, and by how many of its sigmas, for a word. Sound sessions stay within 0.02."""


@dataclass(frozen=True)
class FreeScale:
    """By how much larger the scan would have to be for the lights to explain its shading best."""

    scale: float
    sigma: float
    """Relative."""

    @property
    def warning(self) -> str | None:
        """What to say of a scale that is not 1; None where it may be."""
        log = float(np.log(self.scale))
        if abs(log) < max(SUSPICIOUS, DEVIATIONS * self.sigma):
            return None
        small, large = ("small", "large") if log > 0 else ("large", "small")
        return (
            f"scan: under these lights its shading fits best if it were {self.scale:.3f} times as large (+- "
            f"{self.sigma:.1%}). One length is wrong: the scan is too {small} (scan_unit), or diameter_mm of all the "
            f"balls is too {large}, or the lights' file is in another unit. Lights and distance are wrong "
            "until then: measure a ball and the object with calipers."
        )


def free_scale(evidence: FinalEvidence) -> FreeScale | None:
    """Return the scale of a scan under near lights, None where nothing tells it: distant lights.

    Gauss-Newton on the pose's six unknowns and the logarithm of the scale, with the evidence's own terms; the lights'
    vectors at a point p of a scan s times as large are those at s p. The sigma is that of the pose, made the same way.
    """
    lights, pose = evidence.seen.lights, evidence.pose
    if lights.positions_mm is None or evidence.seen.camera.is_orthographic:
        return None
    points = evidence.surface[0]
    known = np.where(np.isfinite(points), points, lights.reference_point_mm)
    units = np.append(evidence.steps(1.0), 0.01)
    log, matrix = 0.0, np.zeros((7, 7))
    for _ in range(ROUNDS):
        around = [evidence.shading(pose, lights.toward(np.exp(log + side) * known)) for side in (-STEP, 0.0, STEP)]
        slope = (around[2].residuals - around[0].residuals) / (2 * STEP)
        shading = _with_column(around[1], slope)
        outline, _, bias = evidence.terms(pose)
        matrix, pull = np.zeros((7, 7)), np.zeros(7)
        for term in (shading, _with_column(outline, None), _with_column(bias, None)):
            known_of, slope_of, _ = term.information(units)
            matrix += known_of
            pull += slope_of
        step = -np.linalg.lstsq(matrix, pull, rcond=1e-9)[0][6] * units[6]
        log = float(np.clip(log + np.clip(step, -0.15, 0.15), -1.5, 1.5))
        if abs(step) < 1e-3:
            break
    variance = UNMODELLED * float(np.linalg.pinv(matrix, rcond=1e-12, hermitian=True)[6, 6]) * units[6] ** 2
    return FreeScale(float(np.exp(log)), float(np.sqrt(variance)))


def _with_column(term: Term, column: np.ndarray | None) -> Term:
    more = np.zeros(len(term.residuals)) if column is None else column
    return Term(term.residuals, np.column_stack([term.jacobian, more]), term.blocks, term.weight)
