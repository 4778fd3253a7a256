"""The outline that a circle given by hand means."""

from dataclasses import replace

import numpy as np

from calibrate.detection.ball_kind import bright_points, changes
from calibrate.detection.circles import by_points, distinct, standing_circles
from calibrate.detection.coarse import Coarse
from calibrate.silhouette.mirror_outline import outline_of, what_stands
from scene.spheres import Sphere


def around_hint(coarse: Coarse, hint: Sphere, *, reach_px: float) -> list[Sphere]:
    """Return circles of standing edges, full-size pixels, near a circle given by hand; the best supported first.

    Parameters
    ----------
    coarse : Coarse
    hint : Sphere
        Full-size pixels.
    reach_px : float
        How far centre and radius may lie from the hint's, full-size pixels.
    """
    small, reach = coarse.from_full(hint), reach_px / coarse.factor
    side = 1.3 * small.radius_px + 2 * reach + 4
    left, top = np.maximum(np.floor(small.center_px - side), 0).astype(int)
    right, bottom = np.ceil(small.center_px + side).astype(int) + 1
    images = coarse.images[:, top:bottom, left:right]
    if min(images.shape[1:]) < 24:
        return []
    corner = np.array([left, top], np.float64)
    camera = replace(
        coarse.camera,
        width=images.shape[2],
        height=images.shape[1],
        cx=coarse.camera.cx - left,
        cy=coarse.camera.cy - top,
    )
    crop = Coarse(images, camera, coarse.factor)
    small = replace(small, center_px=small.center_px - corner)

    def near(sphere: Sphere) -> bool:
        off = np.hypot(*(sphere.center_px - small.center_px))
        return bool(max(off, abs(sphere.radius_px - small.radius_px)) < reach)

    standing = [sphere for sphere in standing_circles(crop) if near(sphere)]
    found = distinct(standing)[:3]
    if hint.kind == "chrome":
        change = changes(images)
        seen = [(sphere, bright_points(change, sphere)) for sphere in standing]
        groups = by_points([(sphere, points) for sphere, points in seen if points is not None and points.wander])
        standing_still = what_stands(crop)
        outlines = [outline_of(group, standing_still, camera)[0][0][0] for group in groups]
        found = distinct(outlines[:2] + found[:1]) if groups else found
    return [
        replace(
            s,
            kind=hint.kind,
            center_px=coarse.to_full(s.center_px + corner),
            radius_px=float(s.radius_px * coarse.factor),
        )
        for s in found
    ]
