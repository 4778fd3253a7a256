"""The outline that a circle given by hand means."""

from dataclasses import replace

import numpy as np

from calibrate.candidates import find_circles, static_edges
from calibrate.circles import LEAST_SCORE, distinct, outermost
from calibrate.coarse import Coarse
from calibrate.kind import observe
from calibrate.outline import refine_on_edges
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
    votes = static_edges(images)
    edges = np.stack([votes.real, votes.imag], -1)

    def near(sphere: Sphere) -> bool:
        off = np.hypot(*(sphere.center_px - small.center_px))
        return bool(max(off, abs(sphere.radius_px - small.radius_px)) < reach)

    starts = [replace(small, center_px=np.array([c.u, c.v]), radius_px=c.radius) for c in find_circles(images)]
    refined = [refine_on_edges(edges, camera, start) for start in starts if near(start)]
    found: list[Sphere] = []
    for sphere in distinct([s for s in refined if s.score >= LEAST_SCORE])[:3]:
        if hint.kind == "chrome":
            behaviour = observe(crop, sphere)
            if behaviour is not None and behaviour.kind == "chrome":
                sphere, _ = outermost(crop, edges, sphere, behaviour)
        if near(sphere):
            found.append(sphere)
    found = distinct(found)
    return [
        replace(s, center_px=coarse.to_full(s.center_px + corner), radius_px=float(s.radius_px * coarse.factor))
        for s in found
    ]
