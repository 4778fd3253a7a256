"""Vertices at one place become one; faces without area and double faces go."""

import numpy as np
from numpy.typing import NDArray

from align.scan.scan_surface import Surface, connected, renumber
from scene.same_rows import first_of_same, group_numbers

NEAR = 0.1
"""Border vertices closer than this share of the shortest edge at either are one."""


def weld(surface: Surface, repairs: list[str]) -> Surface:
    """Merge vertices at one place, and those of borders at nearly one; drop what then is no face.

    Vertices keep the file's order. What was done is added to `repairs`.
    """
    # Adding zero makes -0 and 0 the same bits.
    surface = _merge(surface, first_of_same(surface.vertices + 0.0), "merged {} duplicate vertices", repairs)
    surface = _drop_bad_faces(surface, repairs)
    used = surface.without_unused()
    if used is not surface:
        repairs.append(f"dropped {len(surface.vertices) - len(used.vertices)} vertices that no face uses")
    near = _near_borders(used)
    tight = Surface(used.vertices, near[used.faces])
    if (near != np.arange(len(near))).any() and len(tight.edges.crowded) > len(used.edges.crowded):
        # Three borders in one place: which two belong together cannot be told.
        apart = np.isin(near, tight.ends(tight.edges.crowded))
        near[apart] = np.flatnonzero(apart)
    merged = _merge(used, near, "merged {} vertices of borders that all but met", repairs)
    return used if merged is used else _drop_bad_faces(merged, repairs)


def _merge(surface: Surface, becomes: NDArray[np.int64], words: str, repairs: list[str]) -> Surface:
    """Return the surface whose vertices became others: `becomes` (V,), the lowest of each group."""
    alone = becomes == np.arange(len(becomes))
    if alone.all():
        return surface
    repairs.append(words.format((~alone).sum()))
    return Surface(surface.vertices[alone], renumber(alone)[becomes][surface.faces])


def _drop_bad_faces(surface: Surface, repairs: list[str]) -> Surface:
    """Return the surface without faces that have no area, and with one of each set of double faces."""
    a, b, c = (surface.vertices[surface.faces[:, corner]] for corner in range(3))
    longest = np.maximum.reduce([np.einsum("tk,tk->t", edge, edge) for edge in (b - a, c - a, c - b)])
    # Relative to the face's own size: a fine scan in metres has honest areas of 1e-9.
    good = np.einsum("tk,tk->t", surface.cross, surface.cross) > (1e-9 * longest) ** 2
    if not good.all():
        repairs.append(f"dropped {(~good).sum()} faces without area")
    surface = surface.with_faces(good)
    alone = first_of_same(np.sort(surface.faces, axis=1)) == np.arange(len(surface.faces))
    if not alone.all():
        repairs.append(f"dropped {(~alone).sum()} double faces")
    return surface.with_faces(alone)


def _near_borders(surface: Surface) -> NDArray[np.int64]:
    """Return for each vertex (V,) which it becomes: patches whose borders meet only nearly are sewn.

    Only border vertices move, and by less than a tenth of their shortest edge, so no face collapses.
    """
    from scipy.spatial import KDTree

    vertices, faces = surface.vertices, surface.faces
    same = np.arange(len(vertices))
    border = np.unique(surface.ends(surface.edges.border))
    if not len(border):
        return same
    at_border = np.zeros(len(vertices), bool)
    at_border[border] = True
    beside = faces[at_border[faces].any(1)]
    start, end = beside.ravel(), np.roll(beside, -1, axis=1).ravel()
    length = np.linalg.norm(vertices[start] - vertices[end], axis=1)
    shortest = np.full(len(vertices), np.inf)
    np.minimum.at(shortest, start, length)
    np.minimum.at(shortest, end, length)
    reach = NEAR * shortest[border]
    tree = KDTree(vertices[border])
    # Eight: around a vertex of a soup, where no two corners quite meet, lie six.
    distance, other = tree.query(vertices[border], k=min(8, len(border)), distance_upper_bound=float(reach.max()))
    near = np.isfinite(distance)
    one, two, distance = np.nonzero(near)[0], np.asarray(other)[near], distance[near]
    near = (one != two) & (distance < np.minimum(reach[one], reach[two]))
    group = connected(one[near], two[near], len(border))
    order, starts = group_numbers(group.astype(np.int64))
    lowest: NDArray[np.int64] = np.minimum.reduceat(border[order], starts)
    same[border] = lowest[group]
    return same
