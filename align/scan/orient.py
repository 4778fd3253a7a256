"""Faces turned so that neighbours agree, and each piece so that its outside is outside."""

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import looking_along
from align.scan.scan_surface import Edges, Surface, connected
from scene.mesh import Mesh
from scene.rays import RayCaster

CLEARLY, SURELY = 0.15, 0.5
"""How much more of the sky the back of a patch must see than its front before it is turned against its file.

Surely where the rest of the file is right, clearly where most of it is wrong too. A cap of a sphere up to 60 degrees
from its pole, inside out, has 0.14, half a sphere 0.33, one of many patches that cover an object nearly 1.
"""
POINTS, DIRECTIONS = 256, 24
"""Rays are cast from so many points a patch, into so many directions on both sides."""


def orient(surface: Surface, repairs: list[str]) -> Surface:
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
    return Surface(surface.vertices, np.where(turned[:, None], faces[:, [0, 2, 1]], faces)) if turned.any() else surface


def _disagreeing(surface: Surface, repairs: list[str]) -> NDArray[np.bool_]:
    """Return which faces (T,) to turn so that neighbours agree; in each piece, one of the two ways to do it."""
    edges, count = surface.edges, len(surface.faces)
    if not edges.against.any():
        return np.zeros(count, bool)
    side = _sides(edges, np.arange(len(edges.one)), count)
    if side is None:
        # A one-sided piece: agreement is given up across its sharpest edges, by a tree of its smoothest ones.
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import minimum_spanning_tree

        normal = surface.cross / surface.area[:, None]
        bend = 2 - np.abs(np.einsum("pk,pk->p", normal[edges.one], normal[edges.two]))
        # Two faces may share two edges: the sum of the bends that a sparse matrix makes of it does no harm.
        tree = minimum_spanning_tree(coo_matrix((bend, (edges.one, edges.two)), (count, count))).tocoo()
        wanted, pairs = (
            np.minimum(a, b) * count + np.maximum(a, b) for a, b in ((tree.row, tree.col), (edges.one, edges.two))
        )
        kept = np.flatnonzero(np.isin(pairs, wanted))
        side = _sides(edges, kept[np.unique(pairs[kept], return_index=True)[1]], count)
        assert side is not None
        left = (side[edges.one] ^ side[edges.two] ^ edges.against).sum()
        repairs.append(f"{left} edges cannot agree (one-sided surface): normals beside them may be reversed")
    return side


def _sides(edges: Edges, some: NDArray[np.int64], count: int) -> NDArray[np.bool_] | None:
    """Two-colour the faces: equal across an edge, unlike across one `against`; None where `some` edges forbid it.

    Each face stands twice in a graph, as it is and turned over, and an edge joins the copies that agree. A
    piece falls apart into two mirrored ones, of which either is an answer; a one-sided piece does not.
    """
    one, two, against = edges.one[some], edges.two[some], edges.against[some]
    label = connected(
        np.concatenate([one, one + count]),
        np.concatenate([two + count * against, two + count * ~against]),
        2 * count,
    )
    as_is, over = label[:count], label[count:]
    return None if (as_is == over).any() else as_is > over


def _front_sees_more(surface: Surface, cross: NDArray, asked: NDArray) -> NDArray:
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
