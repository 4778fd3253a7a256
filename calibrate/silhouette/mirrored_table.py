"""A chrome ball's outline by what it mirrors: the table beside it, which the same photograph shows.

Just inside its outline a mirror shows, squeezed into a few pixels, the table that the picture shows just outside. On a
textured table no smooth profile describes that edge; but the mirror's law does. With a plane for the table, three
unknowns, each pixel inside the outline is some pixel outside of it, dimmed by the reflectance:

    inside   R I(pixel that the mirrored ray meets); f where no pixel shows that,     outside   d + e s

s: distance from the outline; f: what is mirrored beyond the table that is seen, or of a ball that hides it; R: as a
metal's, it rises to 1 at the outline, by the one of two laws that explains more, Fresnel's with a refractive index that
the photographs tell (`calibrate.silhouette.explained_profiles`). The ball stands on the table, one radius from it,
unless the photographs show a foot under it: with a free distance radii came out 0.01 to 0.1 px too large. Outline,
plane and reflectance are shared by all frames and directions; d, e and f are each profile's own (variable projection
[Golub1973]). Texture, shadows and the shadows' edges all speak for the outline then, where they would bend a smooth
profile's. The mirror's picture is squeezed without bound towards the outline; so it is looked up at even steps of the
ball's normal, and blurred as the camera blurs it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.silhouette.explained_profiles import LAWS, REFRACTION, Law, explain, fresnel, schlick
from calibrate.silhouette.mirrored_fit import USUAL, MirroredTable, Start, settle
from calibrate.silhouette.mirrored_surroundings import ANY_PLANE, Surroundings, TablePlane, samples
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Sphere

Array = NDArray[np.float64]
FRAMES, FEW_FRAMES = 12, 2
"""Frames that are looked at: the table is the same in all, only its shadows move; and where many planes are tried, or
circles, as they are."""
UPRIGHT = 0, 90, 180
TILTS = [
    np.tan(np.deg2rad(tilt)) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]) + [0.0, 0.0, 1.0]
    for tilt, azimuths in ((0, [0]), (20, range(0, 360, 45)), (40, UPRIGHT), (60, UPRIGHT))
    for azimuth in np.deg2rad(azimuths)
]
"""Planes with which a fit begins, by the angle to the view and the azimuth, degrees: a table that is seen aslant
recedes towards the picture's upper side, or in a picture on end towards its left or right, never its lower side."""
OTHERWISE = 0.96  # share explained from which another law, or a foot, may explain enough
LIFTED, SURE_LIFT, AS_GOOD = 0.01, 3.0, -0.05
"""Height, radii, from which a foot is tried; the sigmas of its height, and the gain, from which on it is taken: what
equally good fits leave differs by as much, since each has weights of its own."""


class Beside(NamedTuple):
    """What is known of what stands beside a chrome ball, before its outline is fitted."""

    plane: TablePlane | None = None  # what other balls show of the table
    laws: Sequence[Law] = LAWS  # those that the ball's metal may have
    others: Sequence[Sphere] = ()  # balls that hide the table


NOTHING_KNOWN = Beside()


def fit_mirrored_table(
    frames: Frames,
    camera: Camera,
    sphere: Sphere,
    *,
    blur_px: float,
    beside: Beside = NOTHING_KNOWN,
    start: Array | None = None,
    rough: bool = False,
) -> MirroredTable | None:
    """Fit a chrome ball's outline from a start, and a rough blur; None where no table is seen to be mirrored.

    `beside`: what is known already; of two laws the one that explains more is taken. `start` (3,): the plane to begin
    with. `rough`: a few turns only, enough to tell a mirror's outline from another circle.
    """
    plane, laws, others = beside
    table, known = Surroundings(frames.some(FRAMES), camera, sphere, others), ANY_PLANE if plane is None else plane
    if start is None and plane is not None:
        start = plane.values
    elif start is None:
        few = Surroundings(frames.some(FEW_FRAMES), camera, sphere, others)
        start = _rough_plane(few, sphere, blur_px)
    if start is None:
        return None
    begin = sphere, np.append(start[:2], known.values[2]), blur_px
    if rough:
        return settle(table, begin, known, laws[0], rough=True)
    best = _by_its_metal(table, begin, known, laws)
    if best and best.lift > LIFTED and best.explained > OTHERWISE:
        foot = known.of_unknown_height
        lifted = _by_its_metal(table, (sphere, start, blur_px), foot, laws)
        # Where the start explains nothing, that of a ball on the table may.
        lifted = lifted or _by_its_metal(table, best.begin, foot, laws)
        if lifted and lifted.gain(best) > AS_GOOD and lifted.plane.height > SURE_LIFT * lifted.plane.sigma[2]:
            return lifted
    return best


def _by_its_metal(table: Surroundings, begin: Start, known: TablePlane, laws: Sequence[Law]) -> MirroredTable | None:
    """Return the fit by the law that explains more; by Fresnel's, of the metal that does."""
    if len(laws) == 1:
        return settle(table, begin, known, laws[0], rough=False, any_metal=laws[0] is fresnel)
    best = settle(table, begin, known, fresnel, rough=False)
    if best and best.explained < OTHERWISE:
        return best
    other = settle(table, best.begin if best else begin, known, schlick, rough=False)
    if best is None or other is None:
        return best or other
    gain = best.gain(other)
    if gain > 0:
        other = settle(table, best.begin, known, fresnel, rough=False, any_metal=True) or best
    return other._replace(is_fresnels=gain)


def mirrored_share(frames: Frames, camera: Camera, sphere: Sphere, *, blur_px: float, beside: Beside) -> float:
    """Return the share of the profiles' variance that the table explains beside a circle, as it is; 0: unknown."""
    table = Surroundings(frames.some(FEW_FRAMES), camera, sphere, beside.others)
    at = samples(sphere.radius_px, blur_px)
    profiles = table.profiles(sphere, at)
    shown, _ = table.mirrored_by(sphere, (beside.plane or ANY_PLANE).values, at)
    explained = explain(profiles, shown, LAWS[0](at.middle, USUAL, REFRACTION), at.offsets, blur_px)
    return explained.share if explained else 0.0


def _rough_plane(table: Surroundings, sphere: Sphere, blur_px: float) -> Array | None:
    """Return the best of some tilts of a table under the ball, or None where none explains anything."""
    at, best, least = samples(sphere.radius_px, blur_px), None, np.inf
    profiles = table.profiles(sphere, at)
    for plane in TILTS:
        shown, _ = table.mirrored_by(sphere, plane, at)
        explained = explain(profiles, shown, LAWS[0](at.middle, USUAL, REFRACTION), at.offsets, blur_px)
        if explained and explained.hopeful:
            # Of an even table any tilt explains much: a slope must pay for itself.
            left = (1 - explained.share) * float(plane @ plane)
            best, least = (plane, left) if left < least else (best, least)
    return best
