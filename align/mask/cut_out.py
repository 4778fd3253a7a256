"""The object cut out of the picture by its colours, where the backdrop is contradicted by shadows beside it, too."""

import numpy as np
from numpy.typing import NDArray

SURE, REACH = 0.5, 0.1
"""Depth, in that of the piece's deepest pixel, from which a pixel is the object's; and how far beside the piece, in
radii of a disc of its area, the object may reach."""
COLOURFUL, BRIGHT = 3.0, 0.5
"""Weights of a colour's hue and of its brightness: a shadow's edge differs in the second alone."""
TURNS = 5  # of colours and border


def cut_out(picture: NDArray[np.float32], piece: NDArray[np.bool_], never: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the object (h, w) near a piece that holds it: what has its colours and not the backdrop's.

    `picture` (h, w, 3) is linear, without shadows; `never` (h, w) is not the object.

    Notes
    -----
    GrabCut [Rother2004] on CIE L*a*b*: two mixtures of Gaussians, of the object and of what lies beside it, and the
    border that passes where neighbours differ, by turns. A table in the object's shadow has the table's hue.
    """
    import cv2

    white = max(float(np.quantile(picture[piece], 0.99)), 1e-9)
    lab = cv2.cvtColor(np.sqrt(np.clip(picture / white, 0, 1)).astype(np.float32), cv2.COLOR_RGB2LAB)
    lab = np.dstack([255 / 100 * BRIGHT * lab[..., 0], 128 + COLOURFUL * lab[..., 1:]])
    depth = cv2.distanceTransform(piece.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    away = cv2.distanceTransform((~piece).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    label = np.where(away < REACH * np.sqrt(piece.sum() / np.pi), cv2.GC_PR_BGD, cv2.GC_BGD)
    label[piece] = cv2.GC_PR_FGD
    label[depth > SURE * depth.max()] = cv2.GC_FGD
    label[never] = cv2.GC_BGD
    label = np.ascontiguousarray(label, np.uint8)
    cv2.setRNGSeed(0)
    coded, none = np.clip(lab, 0, 255).astype(np.uint8), np.zeros((1, 65))
    cv2.grabCut(coded, label, (0, 0, 0, 0), none, none.copy(), TURNS, cv2.GC_INIT_WITH_MASK)
    return (label == cv2.GC_FGD) | (label == cv2.GC_PR_FGD)
