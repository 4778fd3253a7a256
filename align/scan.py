"""The scan as the scanner wrote it, read and mended."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from align.ply import read_ply
from scene.errors import AlignError
from scene.mesh import Mesh

UNITS_MM = {"m": 1000.0, "cm": 10.0, "mm": 1.0, "inch": 25.4}
SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb")
SMALLEST_PIECE = 0.01
"""A piece with less than this share of the largest piece's area is scanner dust."""


def load_scan(path: Path, unit: str) -> Mesh:
    """Read a scan and mend what can be mended; `Mesh.repairs` says what was done.

    Vertices at one place are merged, degenerate and double faces and unused vertices dropped, pieces below
    1 % of the largest one's area dropped, faces turned so that neighbours agree, and outward.

    Parameters
    ----------
    path : Path
        .ply (binary or ASCII, polygons or triangle strips), .obj, .stl, .off, .glb.
    unit : {"m", "cm", "mm", "inch"}
        The unit of the file's numbers.

    Returns
    -------
    mesh : Mesh
        Millimetres, in the scan's own frame. Texture and colour are left behind.

    Raises
    ------
    AlignError
        The file cannot be read, is a point cloud, is empty, holds positions that are no numbers, or
        is so far from a surface that edges with three and more faces dominate.
    """
    path = Path(path)
    if unit not in UNITS_MM:
        raise AlignError(f"scan_unit: found {unit!r}, expected one of {', '.join(UNITS_MM)}.")
    vertices, faces = _read(path)
    if len(vertices) == 0:
        raise AlignError(f"{path}: the scan is empty. Export it again as a triangle mesh.")
    if len(faces) == 0:
        raise AlignError(
            f"{path}: {len(vertices)} points, but no faces: a point cloud. Mesh it in the scanner's program first."
        )
    bad = ~np.isfinite(vertices).all(1)
    if bad.any():
        raise AlignError(
            f"{path}: {bad.sum()} of {len(vertices)} vertices have no finite position (the first is number "
            f"{np.flatnonzero(bad)[0]}: {vertices[bad][0]}). Export the scan again."
        )
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise AlignError(
            f"{path}: faces name vertices {faces.min()} to {faces.max()}, but there are {len(vertices)}. "
            "The file is damaged; export the scan again."
        )
    repairs: list[str] = []
    vertices, faces = _merge(vertices, faces, repairs)
    faces = _drop_flat(vertices, faces, repairs)
    if len(faces):
        faces = _drop_dust(vertices, faces, repairs)
    if len(faces) < 4:
        raise AlignError(f"{path}: only {len(faces)} faces with an area are left of the scan. Export it again.")
    _check_manifold(path, vertices, faces, repairs)
    faces = _orient(vertices, faces, repairs)
    used, inverse = np.unique(faces, return_inverse=True)
    if len(used) < len(vertices):
        repairs.append(f"dropped {len(vertices) - len(used)} vertices that no face uses")
    return Mesh(vertices[used] * UNITS_MM[unit], inverse.reshape(-1, 3).astype(np.int64), tuple(repairs))


def _read(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    if not path.is_file():
        raise AlignError(f"{path}: there is no such file. Check scan under [object] in session.toml.")
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise AlignError(f"{path}: cannot read a scan with the ending {suffix!r}; expected {', '.join(SUFFIXES)}.")
    if suffix == ".ply":
        return read_ply(path)
    import trimesh

    try:
        # One mesh of all parts, each at its place in the file's scene (GLB).
        mesh = trimesh.load_scene(path, process=False).to_geometry()
    except Exception as error:
        # trimesh raises whatever its parsers stumble over; all of it means a damaged file.
        raise AlignError(f"{path}: cannot be read as a mesh ({error}). Export the scan again.") from error
    vertices = np.asarray(getattr(mesh, "vertices", np.zeros((0, 3))), np.float64)
    return vertices, np.asarray(getattr(mesh, "faces", np.zeros((0, 3))), np.int64).reshape(-1, 3)


def _merge(vertices: NDArray, faces: NDArray, repairs: list[str]) -> tuple[NDArray, NDArray]:
    unique, inverse = np.unique(vertices, axis=0, return_inverse=True)
    if len(unique) == len(vertices):
        return vertices, faces
    repairs.append(f"merged {len(vertices) - len(unique)} duplicate vertices")
    return unique, inverse.ravel()[faces]


def _drop_flat(vertices: NDArray, faces: NDArray, repairs: list[str]) -> NDArray:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.maximum.reduce([((b - a) ** 2).sum(1), ((c - b) ** 2).sum(1), ((a - c) ** 2).sum(1)])
    # Relative to the face's own size: a fine scan in metres has honest areas of 1e-9.
    good = area > 1e-9 * longest
    if not good.all():
        repairs.append(f"dropped {(~good).sum()} faces without area")
    faces = faces[good]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    if len(first) < len(faces):
        repairs.append(f"dropped {len(faces) - len(first)} double faces")
        faces = faces[np.sort(first)]
    return faces


def _drop_dust(vertices: NDArray, faces: NDArray, repairs: list[str]) -> NDArray:
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count = len(vertices)
    start, end = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    graph = coo_matrix((np.ones(len(start), bool), (start, end)), (count, count))
    _, label = connected_components(graph, directed=False)
    piece = label[faces[:, 0]]
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    area = np.bincount(piece, np.linalg.norm(np.cross(b - a, c - a), axis=1))
    keep = area >= SMALLEST_PIECE * area.max()
    dropped = (area > 0) & ~keep
    if dropped.any():
        repairs.append(
            f"dropped {dropped.sum()} loose pieces ({100 * area[dropped].sum() / area.sum():.2g} % of the area)"
        )
    if keep.sum() > 1:
        repairs.append(f"kept {keep.sum()} separate pieces")
    return faces[keep[piece]]


def _edges(faces: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return unique edges (E, 2), each half-edge's edge (3 T,), and whether the half-edge runs low to high (3 T,)."""
    half = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges, inverse = np.unique(np.sort(half, axis=1), axis=0, return_inverse=True)
    return edges, inverse.ravel(), half[:, 0] < half[:, 1]


def _check_manifold(path: Path, vertices: NDArray, faces: NDArray, repairs: list[str]) -> None:
    edges, inverse, _ = _edges(faces)
    crowded = np.flatnonzero(np.bincount(inverse) > 2)
    if not len(crowded):
        return
    share = len(crowded) / len(edges)
    places = "; ".join(
        f"edge {edges[i, 0]}-{edges[i, 1]} at ({', '.join(f'{x:.4g}' for x in vertices[edges[i]].mean(0))})"
        for i in crowded[:3]
    )
    what = f"{len(crowded)} of {len(edges)} edges ({100 * share:.2g} %) have three or more faces: {places}"
    if share > 0.02:
        raise AlignError(
            f"{path}: not the surface of one object: {what}{' ...' if len(crowded) > 3 else ''}. At most 2 % can be "
            "worked with. Repair the scan (for example with MeshLab's 'Repair non manifold edges') and try again."
        )
    repairs.append(f"non-manifold, used as it is: {what}")


def _orient(vertices: NDArray, faces: NDArray, repairs: list[str]) -> NDArray:
    """Turn faces so that neighbours agree, and each piece outward."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    count = len(faces)
    edges, inverse, forward = _edges(faces)
    order = np.argsort(inverse, kind="stable")
    total = np.bincount(inverse, minlength=len(edges))
    first = np.cumsum(total) - total
    # Faces that share an edge of exactly two: they agree if they run along it in opposite directions.
    paired = np.flatnonzero(total == 2)
    one, two = order[first[paired]], order[first[paired] + 1]
    face_one, face_two = one % count, two % count
    disagree = forward[one] == forward[two]
    both = (np.concatenate([face_one, face_two]), np.concatenate([face_two, face_one]))
    graph = csr_matrix((np.tile(disagree + 1.0, 2), both), (count, count))
    pieces, label = connected_components(graph, directed=False)
    flip = np.zeros(count, bool)
    if disagree.any():
        seeds = np.unique(label, return_index=True)[1]
        for seed in seeds[np.isin(np.arange(pieces), np.unique(label[face_one[disagree]]))]:
            nodes, before = breadth_first_order(graph, seed, directed=False)
            # Breadth-first order: a parent comes before its children.
            weights = np.asarray(graph[before[nodes[1:]], nodes[1:]]).ravel() > 1.5
            for node, turn in zip(nodes[1:].tolist(), weights.tolist(), strict=True):
                flip[node] = flip[before[node]] ^ turn
        faces = np.where(flip[:, None], faces[:, [0, 2, 1]], faces)
        repairs.append(f"turned {min(flip.sum(), (~flip).sum())} faces to agree with their neighbours")
        if left := (flip[face_one] ^ flip[face_two] ^ disagree).sum():
            repairs.append(f"{left} edges cannot agree (one-sided surface): normals beside them may be reversed")
    # Outward: the signed volume of the cones from the piece's own middle is positive. For an open piece this
    # is the vote of its faces, weighted by area and by how far they stand out from the middle.
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    weight = np.linalg.norm(cross, axis=1)
    middle_of_face = (a + b + c) / 3
    total_weight = np.bincount(label, weight, pieces)
    middle = np.stack([np.bincount(label, weight * middle_of_face[:, k], pieces) for k in range(3)], -1)
    middle /= total_weight[:, None]
    volume = np.bincount(label, np.einsum("tk,tk->t", middle_of_face - middle[label], cross), pieces)
    inward = volume < 0
    if inward.any():
        faces = np.where(inward[label][:, None], faces[:, [0, 2, 1]], faces)
        repairs.append(f"turned {inward.sum()} of {pieces} pieces outward ({inward[label].sum()} faces)")
    return faces
