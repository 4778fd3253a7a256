"""Lights and pose of a scan whose own shading is the only probe: no ball, no light file, no known normals."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from align.light_probe.candidates import candidates
from align.light_probe.joint_equations import nearness_of
from align.light_probe.joint_fit import Joint, begin, settled
from align.pose.photographed import Photographs
from align.pose.search import STARTS, SURE, best_of, rough_poses
from align.pose.shading import take_samples
from scene.errors import AlignError
from scene.lights import Lights
from scene.pose import Pose
from scene.rays import RayCaster

Array = NDArray[np.float64]
FEWEST_LIGHTS = 5
"""With four, a pixel's own three unknowns leave one sample: nothing tells gloss from light."""
FEW, MANY = 1500, 6000
"""Pixels by which poses are rated and finalists refined; by which the winner is."""
FINALISTS, CLOSE = 5, 1.5
"""Poses that are refined: so many at most, of those whose cost is less than so many times the best one's."""
EARLY = 12
"""Rounds of a finalist."""
VAGUE_DEG, VAGUE_SHARE, USELESS_DEG = 1.0, 0.03, 5.0
"""Sigmas of direction and intensity, medians, from which the object is said to tell too little; from which it does."""


@dataclass(frozen=True)
class ScanLights:
    """What a scan tells of its photographs."""

    lights: Lights
    """About the scan's middle, with their sigmas."""
    pose: Pose
    """camera_from_scan."""
    covariance: Array
    """(6, 6): of the pose, the lights being unknown with it; see `align.pose.register.Registration`."""
    distance_sigma: Array
    """(N,): relative; NaN of distant lights."""
    evidence: str
    warnings: tuple[str, ...]

    def facts(self) -> dict[str, Any]:
        """Return what the summary keeps: model, sigmas (medians; None where there is none)."""
        lights, far = self.lights, self.distance_sigma
        return {
            "model": lights.model,
            "direction_sigma_deg_median": float(np.median(lights.direction_sigma_deg)),
            "intensity_sigma_median": float(np.median(lights.intensity_sigma)),
            "distance_sigma_median": None if lights.positions_mm is None else float(np.median(far)),
        }


def lights_from_scan(
    caster: RayCaster,
    sigma_deg: Array,
    photographs: Photographs,
    *,
    start: Pose | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> ScanLights:
    """Find where a scan stands and where the lights are, by the photographs of the scanned object alone.

    Silhouettes give poses; lights that suit each (one direction and strength a frame, one albedo a pixel) tell which of
    them the photographs can be of. The best are refined with their lights, all unknowns together
    (`align.light_probe.joint_equations`), and compared on the same pixels.

    Parameters
    ----------
    caster : RayCaster
        The scan, mm, with normals freed from its noise.
    sigma_deg : (V,) float
        How sure these are, at its vertices; see `align.scan.smooth_normals`.
    photographs : Photographs
        Their lights are not looked at, but for how many there are.
    start : Pose, optional
        camera_from_scan, some pixels off: no other is looked for.
    executor : Executor, optional
        Runs the starts side by side.
    progress : callable, optional
        Called with (done, total).

    Raises
    ------
    AlignError
        Fewer than five frames; the mask is empty or cut by the image's border; or what is seen of the scan is too flat
        to tell a light.

    Notes
    -----
    Near lights are claimed where it is known how near they are: sectors of the object agree.
    Albedo and intensities share a factor: the mean intensity is 1, and no white value is known.
    """
    photographs = replace(photographs, lights=Lights.unknown(photographs.frames.names))
    photographs.check_mask()
    if photographs.cut_words:
        raise AlignError(f"mask: its outline is all that tells where the scan is.{photographs.cut_words}")
    if len(photographs.frames) < FEWEST_LIGHTS:
        raise AlignError(
            f"scan: {len(photographs.frames)} frames are too few for the scan to tell the lights, expected at least "
            f"{FEWEST_LIGHTS}. Shoot more, put balls beside the object, or give lights.file."
        )
    tell = progress or (lambda done, total: None)
    total = STARTS + FINALISTS + 1
    samples = take_samples(photographs.frames, photographs.lights, photographs.mask, count=FEW)
    rough = rough_poses(caster, photographs, None, start=start, executor=executor, tell=lambda done: tell(done, total))
    rated = candidates(rough, samples)
    found: list[Joint] = []
    for one in (one for one in rated[:FINALISTS] if one.cost < CLOSE * rated[0].cost):
        lights = one.lights(photographs.frames.names, caster.mesh.center_mm)
        first = begin(caster, replace(photographs, lights=lights), one.pose, count=FEW, cells=160)
        found.append(settled(first, sigma_deg, near=True, rounds=EARLY))
        tell(STARTS + len(found), total)
    number, rivals = best_of([one.evidence for one in found])
    best, warnings = found[number], []
    if rivals and rivals[0][1] < SURE:
        turned = (best.evidence.pose.inverse() @ rivals[0][0]).angle_deg()
        warnings.append(
            f"scan: two poses, {turned:.0f} degrees apart, explain the photographs nearly as well, each under lights "
            f"of its own ({rivals[0][1]:.1f} standard deviations): the object looks nearly symmetric. If "
            "lights and normals come out mirrored or turned, give picks under [object]."
        )
    under = replace(photographs, lights=best.evidence.seen.lights)
    best = settled(begin(caster, under, best.evidence.pose, count=MANY, cells=400), sigma_deg, near=True)
    if not best.is_near:
        far = replace(best.evidence.seen.lights, positions_mm=None)
        best = settled(best.evidence.under(far), sigma_deg, near=False)
    tell(total, total)
    return _told(best, warnings)


def _told(best: Joint, warnings: list[str]) -> ScanLights:
    direction, intensity, distance = best.deviations()
    lights = replace(best.evidence.seen.lights, direction_sigma_deg=direction, intensity_sigma=intensity)
    lights.check()
    if np.median(direction) > USELESS_DEG:
        raise AlignError(
            f"scan: its shading does not tell the lights: their directions to {np.median(direction):.0f} degrees "
            f"(median, expected under {USELESS_DEG:g}). It is too flat, too small in the picture, far from matte, or "
            "another object's. Put balls beside the object, or give lights.file."
        )
    how = f"directions to {np.median(direction):.2f} degrees, intensities to {np.median(intensity):.1%}"
    where = "distant lights"
    if best.near:
        far = 1 / nearness_of(lights) / 1000
        where = f"near lights, {far.min():.2f} to {far.max():.2f} m from the object, to {np.median(distance):.1%}"
    evidence = f"no ball and no lights' file: {where}, from the scan's own shading; {how} (medians)"
    warnings = [
        "the lights are from the scan's own shading: methods that are judged by the same scan are judged too kindly. "
        "They suppose a matte object, with some gloss at most.",
        *warnings,
    ]
    if np.median(direction) > VAGUE_DEG or np.median(intensity) > VAGUE_SHARE:
        warnings.append(
            f"scan: its shading tells the lights only roughly: {how}. The object is too flat, too small in the "
            "picture, or far from matte. Put balls beside it in the next capture."
        )
    return ScanLights(lights, best.evidence.pose, best.covariance(), distance, evidence, tuple(warnings))
