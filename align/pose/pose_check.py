"""Is a pose really the best one, and how sharply: what the photographs say around it, and on the way to it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.fit import normals_off_deg
from align.pose.full_resolution import FinalEvidence
from align.pose.motion import apart_px, nudge
from align.pose.observed import Observed
from align.pose.outline_edges import EdgePictures
from align.pose.photographed import Photographs, longer_side
from align.scan.smooth_normals import smooth_normals
from scene.mesh import Mesh
from scene.pose import Pose
from scene.rays import RayCaster

AXES = ("turn about x", "turn about y", "turn about z", "shift along x", "shift along y", "shift along z")
STEPS_PX = (-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0)
"""A turn's or shift's size: by how much it moves the scan's image, or its outline, in pixels."""
STARTS = 3
START_DEG, START_PX = 3.0, 5.0
"""How far from the pose the refinement is started again."""
SAMPLES = 4000
CELLS = 200


@dataclass(frozen=True)
class Residuals:
    """What is left unexplained at a pose."""

    outline_px: float
    """Rms distance from the scan's outline to the photographs' edges, inliers, after their common offset."""
    offset_px: float
    """That offset: how far the outline lies outside the edges on the whole."""
    shading: float
    """Robust standard deviation of the shading's residuals, relative to the pixel's brightness."""
    normals_deg: float
    """Median angle between the scan's normals and those that fit the photographs best."""


@dataclass(frozen=True)
class Along:
    """The cost along one axis through the pose."""

    axis: str
    """One of `AXES`; camera axes, turns about the scan's middle."""
    unit: str
    """Either "deg" or "mm"."""
    per_px: float
    """Degrees or millimetres that move the image by one pixel."""
    cost: NDArray[np.float64]
    """(K,): at `STEPS_PX`: outline and shading together, as the refinement weighs them."""
    minimum_px: float
    """Where the parabola through the cost at -0.5, 0 and 0.5 px has its lowest point; NaN where it has none."""
    sigma_px: float
    """The pose's own standard deviation along the axis."""


@dataclass(frozen=True)
class PoseCheck:
    """What `check_pose` found."""

    here: Residuals
    """At the pose."""
    along: list[Along]
    before: list[Residuals]
    after: list[Residuals]
    """before, after: of each start beside the pose, before and after it was refined."""
    started_px: list[float]
    returned_px: list[float]
    """started_px, returned_px: rms distance of the scan's image from its image at the pose, before and after."""


def check_pose(mesh: Mesh, pose: Pose, photographs: Photographs) -> PoseCheck:
    """Measure the cost around a pose (camera_from_scan) as registered, and refine again from beside it."""
    camera = photographs.camera
    reach = max(6.0, 0.01 * (longer_side(photographs.mask) - 1))
    caster = RayCaster(mesh, smooth_normals(mesh)[0])
    seen = Observed.of(caster, photographs, EdgePictures.of(photographs), count=SAMPLES, cells=CELLS)
    evidence = FinalEvidence(seen, pose, reach)
    along = _around(evidence, evidence.steps(1.0))
    generator = np.random.default_rng(0)
    before, after, started, returned = [], [], [], []
    for _ in range(STARTS):
        there = evidence.renewed(_beside(evidence, generator), reach_px=4 * reach)
        before.append(_residuals(there))
        last = there.refined(rounds=8)
        after.append(_residuals(last))
        started.append(apart_px(mesh, camera, pose, there.pose))
        returned.append(apart_px(mesh, camera, pose, last.pose))
    return PoseCheck(_residuals(evidence), along, before, after, started, returned)


def _around(evidence: FinalEvidence, per_px: NDArray) -> list[Along]:
    pivot = evidence.pose.apply(evidence.seen.caster.mesh.center_mm)
    sigma = np.sqrt(np.maximum(np.diag(evidence.covariance()), 0))
    found = []
    for index, name in enumerate(AXES):
        # An orthographic camera sees no depth.
        if per_px[index] == 0:
            continue
        twists = np.array(STEPS_PX)[:, None] * (np.eye(6)[index] * per_px[index])
        poses = [nudge(evidence.pose, twist, pivot) for twist in twists]
        cost = np.array([sum(term.cost for term in evidence.terms(other)) for other in poses])
        middle = STEPS_PX.index(0.0)
        low, here, high = cost[middle - 1 : middle + 2]
        bend = low - 2 * here + high
        turn = index < 3
        found.append(
            Along(
                name,
                "deg" if turn else "mm",
                float(np.degrees(per_px[index]) if turn else per_px[index]),
                cost,
                float(0.25 * (low - high) / bend) if bend > 0 else np.nan,
                float(sigma[index] / per_px[index]),
            )
        )
    return found


def _beside(evidence: FinalEvidence, generator: np.random.Generator) -> Pose:
    """Return a pose a few degrees and pixels away, in a random direction."""
    axis = generator.standard_normal(3)
    toward = generator.standard_normal(2)
    twist = np.zeros(6)
    twist[:3] = np.radians(START_DEG) * axis / np.linalg.norm(axis)
    twist[3:5] = evidence.steps(START_PX)[3] * toward / np.linalg.norm(toward)
    return nudge(evidence.pose, twist, evidence.pose.apply(evidence.seen.caster.mesh.center_mm))


def _residuals(evidence: FinalEvidence) -> Residuals:
    edges = evidence.edges
    return Residuals(edges.residual_px, edges.bias_px, evidence.shading_sigma, normals_off_deg(evidence))
