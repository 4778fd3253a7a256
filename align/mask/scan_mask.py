"""The object's mask once its scan is registered."""

import numpy as np
from numpy.typing import NDArray

from align.mask.object_mask import ObjectMask
from align.pose.scan_view import box_of


def scan_mask(silhouette: NDArray[np.bool_], found: ObjectMask, *, tolerance_px: float = 3.0) -> ObjectMask:
    """Return the object's mask once its scan is registered.

    The registered silhouette has the better border: sub-pixel, and blind to the table, to shadows and
    to dark albedo. So it is the mask; the found mask adds only what the scan has not: holes inside the
    silhouette (H, W), and parts beyond it that are thicker than twice `tolerance_px` (the scan may be partial): what
    lies closer to the silhouette is the found border's own error.
    """
    from scipy.ndimage import binary_dilation, binary_fill_holes, binary_opening

    shape, window = silhouette.shape, box_of(silhouette | found.mask, margin=int(4 * tolerance_px))
    silhouette, rough = silhouette[window], found.mask[window]
    radius = int(np.ceil(tolerance_px))
    disc = np.hypot(*np.mgrid[-radius : radius + 1, -radius : radius + 1]) <= tolerance_px
    extra = rough & ~silhouette
    in_holes = extra & np.asarray(binary_fill_holes(silhouette), bool)
    near = np.asarray(binary_dilation(silhouette, disc), bool)
    beyond = np.asarray(binary_opening(extra & ~near, disc), bool)
    # Back to where it joins the silhouette.
    beyond = np.asarray(binary_dilation(beyond, disc, iterations=2, mask=extra), bool)
    mask = silhouette | in_holes | beyond
    warnings = list(found.warnings)
    share = (in_holes | beyond).sum() / max(mask.sum(), 1)
    if share > 0.02:
        warnings.append(
            f"mask: {100 * share:.0f} % of it lies beside the registered scan: what was not scanned, or table in the "
            "object's shadow. There is no ground truth there. Look at mask and outline in the report; if it is "
            "shadow, give the mask: mask under [object]."
        )
    missing = (silhouette & ~np.asarray(binary_dilation(rough, disc), bool)).sum() / max(silhouette.sum(), 1)
    if missing > 0.02:
        warnings.append(
            f"mask: {100 * missing:.0f} % of the registered scan lies outside the mask that was {found.source}: "
            "something hides the object there, or the mask lacks it."
        )
    whole = np.zeros(shape, bool)
    whole[window] = mask
    return ObjectMask(whole, "scan", tuple(warnings))
