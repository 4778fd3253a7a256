"""How well a pose explains the photographs, in terms that a wrong scan cannot meet."""

from typing import NamedTuple

import numpy as np

from align.pose.appearance import free_normals
from align.pose.full_resolution import NEAREST_PX, FinalEvidence
from align.pose.motion import nudge
from align.pose.photographed import FEWEST, shading_tells
from scene.normals import angular_error_deg

WORST_MISFIT = 1.0
"""Above it the scan is refused."""
NORMALS_DEG, OF_BESIDE, APART, OUTSIDE = 5.0, 0.55, 0.75, 0.35
"""The most that a right scan's normals are off, or as a share of what they are when it is turned; that its outline is
beside the edges; and what of its silhouette and the mask together may not be common to both: a mask may have taken in
the object's shadow."""
BESIDE_DEG = 8.0
"""By how much the scan is turned about each axis, to see what a wrong normal looks like on this material."""
ALIKE, ALIKE_DEG = 0.8, 2.5
"""Share of their angle when the scan is turned from which on its normals do not tell how it is turned, and the most
that they are off then. Right scans had 0.7 at most but a ball, 1.2 degrees off; wrong ones of a scene with five
flashes, 9 to 14 degrees off, 0.9 to 1.05, and 4 degrees and more."""
ASKED = 500
"""Pixels, about, whose best normals are looked for."""


class Fit(NamedTuple):
    """How well a pose explains the photographs, in terms that a wrong scan cannot meet."""

    overlap: float
    """Intersection over union of the scan's silhouette and the mask."""
    normals_deg: float
    """Median angle between the scan's normals and those that fit the photographs best, pixel by pixel, under the same
    lights, for the same material, and with the same samples."""
    beside_deg: float
    """The same, median, of the scan turned by `BESIDE_DEG` about each of the camera's axes, either way."""
    apart: float
    """Median distance from the outline to the edges in the photographs, in units of `ObservedObject.near_px`."""

    @property
    def misfit(self) -> float:
        """One number: a scan is refused above 1.

        A metal shows the table and itself, and its normals look wrong where they are right. So they do, then, and more
        so, where they are wrong by `BESIDE_DEG`: the angle is judged as a share of that one. A ball looks the same
        turned; an angle that is small is enough, then: `most_deg`. Where no photographs tell the normals the outline
        judges alone.
        """
        shading = (
            0.0
            if np.isnan(self.normals_deg)
            else min(self.normals_deg / self.most_deg, self.normals_deg / max(self.beside_deg, 1e-9) / OF_BESIDE)
        )
        return max(shading, self.apart / APART, (1 - self.overlap) / OUTSIDE)

    @property
    def most_deg(self) -> float:
        """The most that its normals may be off: less where they would be as much off if it were turned."""
        return ALIKE_DEG if self.is_alike_turned else NORMALS_DEG

    @property
    def is_alike_turned(self) -> bool:
        """Whether its normals fit as well when it is turned: a ball's do, and those of a scan that fits badly."""
        return self.normals_deg > ALIKE * self.beside_deg

    @property
    def words(self) -> str:
        told = (
            f"at the best pose the silhouette overlaps the mask by {100 * self.overlap:.1f} % (expected above "
            f"{100 * (1 - OUTSIDE):.0f} %), the scan's outline is {self.apart:.2g} (median) of a pixel, or in a "
            f"large picture of 0.5 % of the object, from the edges in the photographs (expected below {APART:g})"
        )
        shading = (
            f", and its normals are {self.normals_deg:.1f} degrees (median) from what the photographs show (expected "
            f"below {self.most_deg:g}, or below {100 * OF_BESIDE:.0f} % of the {self.beside_deg:.1f} that they are "
            f"when it is turned by {BESIDE_DEG:g} degrees)"
        )
        return told + shading * (not np.isnan(self.normals_deg))


def fit_of(evidence: FinalEvidence) -> Fit:
    """Return how well the evidence's pose fits."""
    pivot = evidence.pose.apply(evidence.seen.caster.mesh.center_mm)
    beside = []
    for turn in np.radians(BESIDE_DEG) * np.concatenate([np.eye(3), -np.eye(3)]):
        pose = nudge(evidence.pose, np.concatenate([turn, np.zeros(3)]), pivot)
        beside.append(normals_off_deg(evidence.renewed(pose, reach_px=NEAREST_PX)))
    return Fit(
        evidence.outline.overlap(evidence.seen.mask),
        normals_off_deg(evidence),
        float(np.median(beside)),
        evidence.edges.apart_px / evidence.seen.near_px,
    )


def normals_off_deg(evidence: FinalEvidence) -> float:
    """Return the median angle, degrees, between the scan's normals and those that photographs tell; nan: none does."""
    normals, samples, shown = evidence.surface[1], evidence.seen.samples, evidence.used.sum(0)
    # Of four photographs all must show a pixel; with more, one that only four show tells too little.
    asked = np.flatnonzero(shown > min(FEWEST, len(evidence.used) - 1))
    if not len(asked):
        return 90.0 if shading_tells(evidence.seen.lights) else float("nan")
    asked = asked[:: max(1, len(asked) // ASKED)]
    used, own = evidence.used[:, asked], normals[asked]
    values = np.where(used, samples.values[:, asked], 0) / samples.scale[asked]
    best = free_normals(values, used, own, evidence.lit.only(asked), evidence.look)
    return float(np.median(angular_error_deg(best, own)))
