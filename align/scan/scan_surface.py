"""A scan's surface while it is mended, a `trimesh.Trimesh`: vertices at one place made one, faces turned.

Faces are turned so that neighbours agree, and each piece so that its outside is outside. Vertices and faces stand in
the file's unit and order.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import looking_along
from scene.mesh import Mesh, first_of_same
from scene.rays import RayCaster

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
CLEARLY, SURELY = 0.15, 0.5
"""How much more of the sky the back of a patch must see than its front before it is turned against its file.

Surely where the rest of the file is right, clearly where most of it is wrong too. A cap of a sphere up to 60 degrees
from its pole, inside out, has 0.14, half a sphere 0.33, one of many patches that cover an object nearly 1.
"""
NEAR = 0.1
"""Border vertices closer than this share of the shortest border edges are one: a rotated .glb has its seams so."""
POINTS, DIRECTIONS = 256, 24
"""Rays are cast from so many points a patch, into so many directions on both sides."""


def surface_of(vertices: Array, faces: Integers) -> Any:
    """Return vertices (V, 3) and faces (T, 3) as a `trimesh.Trimesh`, nothing of them changed."""
    import trimesh

    return trimesh.Trimesh(vertices, faces, process=False, validate=False)


def sharing(surface: Any) -> Integers:
    """Return how many faces share the edge of each of `surface.edges` (3 T,)."""
    inverse = surface.edges_unique_inverse
    return np.bincount(inverse)[inverse]


def border_of(surface: Any) -> Integers:
    """Return the ends (B, 2) of the edges that have one face."""
    return surface.edges[sharing(surface) == 1]


def pieces_of(surface: Any) -> NDArray[np.int32]:
    """Return the number (T,) of the connected piece that each face belongs to."""
    from trimesh.graph import connected_component_labels

    return connected_component_labels(surface.face_adjacency, len(surface.faces))


def weld(surface: Any, repairs: list[str]) -> Any:
    """Merge vertices at one place, and those of borders at nearly one; drop what then is no face.

    Vertices keep the file's order. What was done is added to `repairs`.
    """
    # Adding zero makes -0 and 0 the same bits.
    same = first_of_same(np.asarray(surface.vertices) + 0.0)
    surface = _drop_bad_faces(_merge(surface, same, "merged {} duplicate vertices", repairs), repairs)
    if not len(surface.faces):
        return surface
    count = len(surface.vertices)
    surface.remove_unreferenced_vertices()
    if count > len(surface.vertices):
        repairs.append(f"dropped {count - len(surface.vertices)} vertices that no face uses")
    near = _near_borders(surface)
    if (near == np.arange(len(near))).all():
        return surface
    tight = surface_of(surface.vertices, near[surface.faces])
    crowded = sharing(tight) > 2
    if crowded.sum() > (sharing(surface) > 2).sum():
        # Three borders in one place: which two belong together cannot be told.
        apart = np.isin(near, tight.edges[crowded])
        near[apart] = np.flatnonzero(apart)
    return _drop_bad_faces(_merge(surface, near, "merged {} vertices of borders that all but met", repairs), repairs)


def _merge(surface: Any, becomes: Integers, words: str, repairs: list[str]) -> Any:
    """Return the surface whose vertices became others: `becomes` (V,), the lowest of each group."""
    alone = becomes == np.arange(len(becomes))
    if alone.all():
        return surface
    repairs.append(words.format((~alone).sum()))
    return surface_of(surface.vertices[alone], (np.cumsum(alone) - 1)[becomes][surface.faces])


def _drop_bad_faces(surface: Any, repairs: list[str]) -> Any:
    """Return the surface without faces that have no area, and with one of each set of double faces."""
    sides = surface.vertices[surface.faces] - surface.vertices[np.roll(surface.faces, 1, axis=1)]
    longest = np.einsum("tck,tck->tc", sides, sides).max(1, initial=0)
    # Relative to the face's own size: a fine scan in metres has honest areas of 1e-9.
    good = 2 * surface.area_faces > 1e-9 * longest
    if not good.all():
        repairs.append(f"dropped {(~good).sum()} faces without area")
    faces = surface.faces[good]
    alone = first_of_same(np.sort(faces, axis=1)) == np.arange(len(faces))
    if not alone.all():
        repairs.append(f"dropped {(~alone).sum()} double faces")
    return surface if len(faces) == len(surface.faces) and alone.all() else surface_of(surface.vertices, faces[alone])


def _near_borders(surface: Any) -> Integers:
    """Return for each vertex (V,) which it becomes: patches whose borders meet only nearly are sewn."""
    from scipy.spatial import KDTree
    from trimesh.graph import connected_component_labels

    vertices, ends = np.asarray(surface.vertices), border_of(surface)
    same = np.arange(len(vertices))
    if not len(ends):
        return same
    border = np.unique(ends)
    shortest = np.quantile(np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1), 0.01)
    near = KDTree(vertices[border]).query_pairs(NEAR * shortest, output_type="ndarray")
    group = connected_component_labels(near, len(border))
    same[border] = border[np.unique(group, return_index=True)[1][group]]
    return same


def orient(surface: Any, repairs: list[str]) -> Any:
    """Turn faces so that neighbours agree, and pieces so that they look outward.

    The winding that most of a piece's area has is its file's vote. A closed piece is then judged by its volume,
    which cannot err. An open one has none: rays tell which side sees more of the sky [Takayama2014], and
    as a hollow patch may rightly see less of it, the file is overruled only where they tell it clearly.
    """
    area, piece, faces = surface.area_faces, pieces_of(surface), np.asarray(surface.faces)
    pieces = int(piece.max()) + 1
    whole = np.bincount(piece, area, pieces)
    turned = _disagreeing(surface, repairs)
    share = np.bincount(piece, np.where(turned, area, 0), pieces) / whole
    # The majority stays as the file has it.
    turned ^= (share > 0.5)[piece]
    share = np.minimum(share, 1 - share)
    if turned.any():
        repairs.append(f"turned {turned.sum()} faces to agree with their neighbours")
    cross = np.where(turned[:, None], -surface.triangles_cross, surface.triangles_cross)

    is_open = np.zeros(pieces, bool)
    is_open[piece[surface.edges_face[sharing(surface) == 1]]] = True
    center = surface.triangles_center
    middle = np.stack([np.bincount(piece, area * axis, pieces) for axis in center.T], -1) / whole[:, None]
    # Six times the volume of the cones from the piece's middle.
    inward = np.bincount(piece, np.einsum("tk,tk->t", center - middle[piece], cross), pieces) < 0
    if is_open.any():
        more = _front_sees_more(surface, cross, piece, np.flatnonzero(is_open))
        # A piece whose winding was mixed in the file has no say in it.
        mixed = share[is_open] > 0.25
        inward[is_open] = more < -CLEARLY
        trusted = whole[inward].sum() < 0.5 * whole.sum()
        inward[is_open] = more < np.where(mixed, 0, -SURELY if trusted else -CLEARLY)
        if unsure := (mixed & (np.abs(more) < CLEARLY / 3)).sum():
            repairs.append(f"{unsure} open pieces were wound at random and see the sky on both sides: guessed outward")
    if inward.any():
        repairs.append(f"turned {inward.sum()} of {pieces} pieces outward ({inward[piece].sum()} faces)")
    turned ^= inward[piece]
    return surface_of(surface.vertices, np.where(turned[:, None], faces[:, [0, 2, 1]], faces))


def _disagreeing(surface: Any, repairs: list[str]) -> NDArray[np.bool_]:
    """Return which faces (T,) to turn so that neighbours agree; in each piece, one of the two ways to do it."""
    from trimesh.graph import connected_component_labels

    count, (one, two), ends = len(surface.faces), surface.face_adjacency.T, surface.face_adjacency_edges
    start, end = np.asarray(surface.faces), np.roll(surface.faces, -1, axis=1)
    runs = (((start[own] == ends[:, :1]) & (end[own] == ends[:, 1:])).any(1) for own in (one, two))
    # Two that run along their edge in the same direction: one of them is turned over.
    against = np.equal(*runs)
    if not against.any():
        return np.zeros(count, bool)
    # Each face stands twice in a graph, as it is and turned over, and an edge joins the copies that agree. A piece
    # falls apart into two mirrored ones, of which either is an answer; a one-sided piece does not.
    over = count * against
    pairs = np.concatenate([[one, two + over], [one + count, two + count - over]], 1).T
    label = connected_component_labels(pairs, 2 * count)
    as_is, turned = label[:count], label[count:]
    if (as_is == turned).any():
        repairs.append(f"{(as_is == turned).sum()} faces are of a one-sided surface: normals there may be reversed")
    return as_is > turned


def _front_sees_more(surface: Any, cross: NDArray, piece: NDArray, asked: NDArray) -> NDArray:
    """Return (front - back) / (front + back) of what pieces `asked` (N,) see of the sky, in -1..1."""
    generator, area = np.random.default_rng(0), surface.area_faces
    mesh = Mesh(np.asarray(surface.vertices), np.asarray(surface.faces))
    caster = RayCaster(mesh)
    # Cosine-weighted directions about z: uniform on the disc, lifted to the hemisphere.
    radius, angle = np.sqrt(generator.random(DIRECTIONS)), 2 * np.pi * generator.random(DIRECTIONS)
    lobe = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - radius**2)], -1)
    order = np.argsort(piece, kind="stable")
    starts, stops = (np.searchsorted(piece[order], asked, side) for side in ("left", "right"))
    answer = np.zeros(len(asked))
    for number, (start, stop) in enumerate(zip(starts, stops, strict=True)):
        own = order[start:stop]
        weight = np.cumsum(area[own])
        picked = own[np.searchsorted(weight, generator.random(POINTS) * weight[-1] * (1 - 1e-9))]
        normal = cross[picked] / (2 * area[picked, None])
        seen = []
        for sign in (1.0, -1.0):
            rays = np.einsum("dk,pkj->pdj", lobe * [1, 1, sign], looking_along(normal)).reshape(-1, 3)
            origin = surface.triangles_center[picked] + sign * 1e-5 * mesh.radius_mm * normal
            far = np.full(len(rays), 4 * mesh.radius_mm)
            seen.append((~caster.blocked(np.repeat(origin, DIRECTIONS, axis=0), rays, far)).sum())
        answer[number] = (seen[0] - seen[1]) / max(seen[0] + seen[1], 1)
    return answer
