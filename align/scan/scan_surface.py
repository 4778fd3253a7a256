"""A scan's surface while it is mended: which faces share which edges, vertices at one place made one, faces turned.

Faces are turned so that neighbours agree, and each piece so that its outside is outside.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import looking_along
from scene.mesh import Mesh
from scene.rays import RayCaster
from scene.same_rows import Integers, first_of_same, group_numbers

Array = NDArray[np.float64]
CLEARLY, SURELY = 0.15, 0.5
"""How much more of the sky the back of a patch must see than its front before it is turned against its file.

Surely where the rest of the file is right, clearly where most of it is wrong too. A cap of a sphere up to 60 degrees
from its pole, inside out, has 0.14, half a sphere 0.33, one of many patches that cover an object nearly 1.
"""
NEAR = 0.1
"""Border vertices closer than this share of the shortest edge at either are one: a rotated .glb has its seams so."""
POINTS, DIRECTIONS = 256, 24
"""Rays are cast from so many points a patch, into so many directions on both sides."""


@dataclass(frozen=True)
class MeshEdges:
    """The edges of T faces. A half-edge h is edge h // T of face h % T: from its corner h // T to the next."""

    one: Integers
    two: Integers
    """one, two: (P,): faces that share an edge of exactly two."""
    against: NDArray[np.bool_]
    """(P,): whether the two run along it in the same direction: one of them is turned over."""
    border: Integers
    """(B,). Half-edges whose edge has no other face."""
    crowded: Integers
    """(C,): one half-edge of each edge with three and more faces."""

    @property
    def total(self) -> int:
        """How many edges there are."""
        return len(self.one) + len(self.border) + len(self.crowded)


@dataclass(frozen=True)
class ScanSurface:
    """Vertices (V, 3) in the file's unit, faces (T, 3), and what follows from them, computed once when asked for."""

    vertices: Array
    faces: Integers

    @cached_property
    def cross(self) -> Array:
        """(T, 3) (b - a) x (c - a): along the normal, twice the area long."""
        a = self.vertices[self.faces[:, 0]]
        return np.cross(self.vertices[self.faces[:, 1]] - a, self.vertices[self.faces[:, 2]] - a)

    @cached_property
    def area(self) -> Array:
        """(T,) twice the faces' areas."""
        return np.sqrt(np.einsum("tk,tk->t", self.cross, self.cross))

    @cached_property
    def middle(self) -> Array:
        """(T, 3) the faces' middles."""
        total = self.vertices[self.faces[:, 0]]
        total += self.vertices[self.faces[:, 1]]
        total += self.vertices[self.faces[:, 2]]
        total /= 3
        return total

    @cached_property
    def edges(self) -> MeshEdges:
        count, faces = len(self.faces), self.faces
        start, end = faces.T.ravel(), faces[:, [1, 2, 0]].T.ravel()
        forward = start < end
        keys = np.where(forward, start, end) * (faces.max(initial=0) + 1) + np.where(forward, end, start)
        order, first = group_numbers(keys)
        total = np.diff(first, append=len(keys))
        one, two = order[first[total == 2]], order[first[total == 2] + 1]
        against = forward[one] == forward[two]
        return MeshEdges(one % count, two % count, against, order[first[total == 1]], order[first[total > 2]])

    def ends(self, half_edges: Integers) -> Integers:
        """Return the two vertices (N, 2) of half-edges (N,)."""
        face, corner = half_edges % len(self.faces), half_edges // len(self.faces)
        return np.stack([self.faces[face, corner], self.faces[face, (corner + 1) % 3]], -1)

    @cached_property
    def piece(self) -> NDArray[np.int32]:
        """(T,) the number of the connected piece that each face belongs to."""
        return connected(self.edges.one, self.edges.two, len(self.faces))

    def with_faces(self, kept: NDArray[np.bool_]) -> "ScanSurface":
        """Return the surface of the faces `kept` (T,), all vertices with it."""
        return self if kept.all() else ScanSurface(self.vertices, self.faces[kept])

    def without_unused(self) -> "ScanSurface":
        """Return the surface without the vertices that no face uses."""
        used = np.zeros(len(self.vertices), bool)
        used[self.faces] = True
        return self if used.all() else ScanSurface(self.vertices[used], renumber(used)[self.faces])


def connected(one: Integers, two: Integers, count: int) -> NDArray[np.int32]:
    """Return the connected component (count,) of each of `count` nodes under the links one - two."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(one), np.int8), (one, two)), (count, count))
    return connected_components(graph, directed=False)[1]


def renumber(kept: NDArray[np.bool_]) -> Integers:
    """Return the new index (N,) of each old one when only `kept` (N,) stay."""
    return np.cumsum(kept) - 1


def weld(surface: ScanSurface, repairs: list[str]) -> ScanSurface:
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
    tight = ScanSurface(used.vertices, near[used.faces])
    if (near != np.arange(len(near))).any() and len(tight.edges.crowded) > len(used.edges.crowded):
        # Three borders in one place: which two belong together cannot be told.
        apart = np.isin(near, tight.ends(tight.edges.crowded))
        near[apart] = np.flatnonzero(apart)
    merged = _merge(used, near, "merged {} vertices of borders that all but met", repairs)
    return used if merged is used else _drop_bad_faces(merged, repairs)


def _merge(surface: ScanSurface, becomes: NDArray[np.int64], words: str, repairs: list[str]) -> ScanSurface:
    """Return the surface whose vertices became others: `becomes` (V,), the lowest of each group."""
    alone = becomes == np.arange(len(becomes))
    if alone.all():
        return surface
    repairs.append(words.format((~alone).sum()))
    return ScanSurface(surface.vertices[alone], renumber(alone)[becomes][surface.faces])


def _drop_bad_faces(surface: ScanSurface, repairs: list[str]) -> ScanSurface:
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


def _near_borders(surface: ScanSurface) -> NDArray[np.int64]:
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


def orient(surface: ScanSurface, repairs: list[str]) -> ScanSurface:
    """Turn faces so that neighbours agree, and pieces so that they look outward.

    The winding that most of a piece's area has is its file's vote. A closed piece is then judged by its volume,
    which cannot err. An open one has none: rays tell which side sees more of the sky [Takayama2014], and
    as a hollow patch may rightly see less of it, the file is overruled only where they tell it clearly.
    """
    area, piece, faces = surface.area, surface.piece, surface.faces
    pieces = int(piece.max()) + 1
    whole = np.bincount(piece, area, pieces)
    turned = _disagreeing(surface, repairs)
    share = np.bincount(piece, np.where(turned, area, 0), pieces) / whole
    # The majority stays as the file has it.
    turned ^= (share > 0.5)[piece]
    share = np.minimum(share, 1 - share)
    if turned.any():
        repairs.append(f"turned {turned.sum()} faces to agree with their neighbours")
    cross = np.where(turned[:, None], -surface.cross, surface.cross)

    is_open = np.zeros(pieces, bool)
    is_open[piece[surface.edges.border % len(faces)]] = True
    middle = np.stack([np.bincount(piece, area * surface.middle[:, k], pieces) for k in range(3)], -1) / whole[:, None]
    # Six times the volume of the cones from the piece's middle.
    inward = np.bincount(piece, np.einsum("tk,tk->t", surface.middle - middle[piece], cross), pieces) < 0
    if is_open.any():
        more = _front_sees_more(surface, cross, np.flatnonzero(is_open))
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
    return (
        ScanSurface(surface.vertices, np.where(turned[:, None], faces[:, [0, 2, 1]], faces))
        if turned.any()
        else surface
    )


def _disagreeing(surface: ScanSurface, repairs: list[str]) -> NDArray[np.bool_]:
    """Return which faces (T,) to turn so that neighbours agree; in each piece, one of the two ways to do it."""
    edges, count = surface.edges, len(surface.faces)
    if not edges.against.any():
        return np.zeros(count, bool)
    # Each face stands twice in a graph, as it is and turned over, and an edge joins the copies that agree. A piece
    # falls apart into two mirrored ones, of which either is an answer; a one-sided piece does not.
    one, two, over = edges.one, edges.two, count * edges.against
    label = connected(np.concatenate([one, one + count]), np.concatenate([two + over, two + count - over]), 2 * count)
    as_is, turned = label[:count], label[count:]
    if (as_is == turned).any():
        repairs.append(f"{(as_is == turned).sum()} faces are of a one-sided surface: normals there may be reversed")
    return as_is > turned


def _front_sees_more(surface: ScanSurface, cross: NDArray, asked: NDArray) -> NDArray:
    """Return (front - back) / (front + back) of what pieces `asked` (N,) see of the sky, in -1..1."""
    generator = np.random.default_rng(0)
    mesh = Mesh(surface.vertices, surface.faces)
    caster = RayCaster(mesh)
    # Cosine-weighted directions about z: uniform on the disc, lifted to the hemisphere.
    radius, angle = np.sqrt(generator.random(DIRECTIONS)), 2 * np.pi * generator.random(DIRECTIONS)
    lobe = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - radius**2)], -1)
    order = np.argsort(surface.piece, kind="stable")
    starts = np.searchsorted(surface.piece[order], asked)
    stops = np.searchsorted(surface.piece[order], asked, side="right")
    answer = np.zeros(len(asked))
    for number, (start, stop) in enumerate(zip(starts, stops, strict=True)):
        own = order[start:stop]
        weight = np.cumsum(surface.area[own])
        picked = own[np.searchsorted(weight, generator.random(POINTS) * weight[-1] * (1 - 1e-9))]
        normal = cross[picked] / surface.area[picked, None]
        seen = []
        for sign in (1.0, -1.0):
            rays = np.einsum("dk,pkj->pdj", lobe * [1, 1, sign], looking_along(normal)).reshape(-1, 3)
            origin = np.repeat(surface.middle[picked] + sign * 1e-5 * mesh.radius_mm * normal, DIRECTIONS, axis=0)
            seen.append((~caster.blocked(origin, rays, np.full(len(rays), 4 * mesh.radius_mm))).sum())
        answer[number] = (seen[0] - seen[1]) / max(seen[0] + seen[1], 1)
    return answer
