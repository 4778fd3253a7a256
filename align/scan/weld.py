"""Vertices at one place become one; faces without area and double faces go."""

import numpy as np
from numpy.typing import NDArray

from align.scan.edges import Edges, edges_of
from align.scan.same_rows import first_of_same, group_numbers, renumber

Vertices = NDArray[np.float64]
Faces = NDArray[np.int64]

NEAR = 0.1
"""Border vertices closer than this share of the shortest edge at either are one."""


def weld(vertices: Vertices, faces: Faces, repairs: list[str]) -> tuple[Vertices, Faces, Edges]:
    """Merge vertices at one place, and those of borders at nearly one; drop what then is no face.

    Parameters
    ----------
    vertices : (V, 3) float64
    faces : (T, 3) int64
    repairs : list of str
        What was done is added to it.

    Returns
    -------
    vertices : (W, 3) float64
        In the file's order.
    faces : (S, 3) int64
    edges : Edges
        Of these faces.
    """
    # Adding zero makes -0 and 0 the same bits.
    first = first_of_same(vertices + 0.0)
    alone = first == np.arange(len(vertices))
    if not alone.all():
        repairs.append(f"merged {(~alone).sum()} duplicate vertices")
        vertices, faces = vertices[alone], renumber(alone)[first][faces]
    faces = _drop_double(_drop_flat(vertices, faces, repairs), repairs)
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    if not used.all():
        repairs.append(f"dropped {(~used).sum()} vertices that no face uses")
        vertices, faces = vertices[used], renumber(used)[faces]
    edges = edges_of(faces)
    near = _near_borders(vertices, faces, edges)
    alone = near == np.arange(len(vertices))
    if not alone.all() and len((tight := edges_of(near[faces])).crowded) > len(edges.crowded):
        # Three borders in one place: which two belong together cannot be told.
        apart = np.isin(near, tight.ends(near[faces], tight.crowded))
        near[apart] = np.flatnonzero(apart)
        alone |= apart
    if alone.all():
        return vertices, faces, edges
    repairs.append(f"merged {(~alone).sum()} vertices of borders that all but met")
    vertices, faces = vertices[alone], renumber(alone)[near[faces]]
    faces = _drop_double(_drop_flat(vertices, faces, repairs), repairs)
    return vertices, faces, edges_of(faces)


def _drop_flat(vertices: Vertices, faces: Faces, repairs: list[str]) -> Faces:
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    b -= a
    c -= a
    longest = np.maximum(np.einsum("tk,tk->t", b, b), np.einsum("tk,tk->t", c, c))
    cross = np.cross(b, c)
    b -= c
    np.maximum(longest, np.einsum("tk,tk->t", b, b), out=longest)
    # Relative to the face's own size: a fine scan in metres has honest areas of 1e-9.
    good = np.einsum("tk,tk->t", cross, cross) > (1e-9 * longest) ** 2
    if good.all():
        return faces
    repairs.append(f"dropped {(~good).sum()} faces without area")
    return faces[good]


def _drop_double(faces: Faces, repairs: list[str]) -> Faces:
    first = first_of_same(np.sort(faces, axis=1))
    alone = first == np.arange(len(faces))
    if alone.all():
        return faces
    repairs.append(f"dropped {(~alone).sum()} double faces")
    return faces[alone]


def _near_borders(vertices: Vertices, faces: Faces, edges: Edges) -> NDArray[np.int64]:
    """Return for each vertex (V,) which it becomes: patches whose borders meet only nearly are sewn.

    Only border vertices move, and by less than a tenth of their shortest edge, so no face collapses.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    same = np.arange(len(vertices))
    border = np.unique(edges.border_ends(faces))
    if not len(border):
        return same
    at_border = np.zeros(len(vertices), bool)
    at_border[border] = True
    beside = faces[at_border[faces[:, 0]] | at_border[faces[:, 1]] | at_border[faces[:, 2]]]
    start, end = beside.ravel(), np.roll(beside, -1, axis=1).ravel()
    length = np.linalg.norm(vertices[start] - vertices[end], axis=1)
    shortest = np.full(len(vertices), np.inf)
    np.minimum.at(shortest, start, length)
    np.minimum.at(shortest, end, length)
    reach = NEAR * shortest[border]
    tree = KDTree(vertices[border])
    # Eight: around a vertex of a soup, where no two corners quite meet, lie six.
    distance, other = tree.query(vertices[border], k=min(8, len(border)), distance_upper_bound=float(reach.max()))
    one = np.repeat(np.arange(len(border)), distance.shape[1])
    two, distance = other.ravel(), distance.ravel()
    near = np.isfinite(distance)
    one, two, distance = one[near], two[near], distance[near]
    near = (one != two) & (distance < np.minimum(reach[one], reach[two]))
    if not near.any():
        return same
    graph = coo_matrix((np.ones(near.sum(), bool), (one[near], two[near])), (len(border), len(border)))
    _, group = connected_components(graph, directed=False)
    order, starts = group_numbers(group.astype(np.int64))
    lowest = np.minimum.reduceat(border[order], starts)
    same[border] = lowest[group]
    return same
