"""Pictures and normals made smaller: what is left is still in its place."""

import numpy as np

from align.pose.photographed import sparse_normals


def test_sparse_normals_are_those_of_the_pixel_nearby():
    v, u = np.mgrid[0:1700, 0:1611]
    mask = np.hypot(v - 800, u - 790) < 700
    asked = []

    def solve(some):
        asked.append(some)
        place = np.stack([u, v, u * 0], -1).astype(np.float32)
        return np.where(some[..., None], place, np.nan)

    normals = sparse_normals(mask, solve)
    inside = np.hypot(v - 800, u - 790) < 698
    # Solved on a fourth of them, given to each, from a pixel away and to no side more than to the other.
    assert asked[0].sum() < 0.26 * mask.sum()
    assert (asked[0] <= mask).all()
    away = normals[inside][:, :2] - np.stack([u, v], -1)[inside]
    assert np.abs(away).max() <= 1
    assert np.abs(away.mean(0)).max() <= 0.51
