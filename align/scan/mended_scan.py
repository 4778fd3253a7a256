"""The scan as the scanner wrote it, read and mended: docs/reference/file-formats.md says the same for users."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from align.scan.beside_object import find_balls, find_table
from align.scan.scan_surface import border_of, orient, pieces_of, surface_of, weld
from formats.meshes.scan_files import read_scan
from scene.errors import AlignError
from scene.length_units import UNITS_MM
from scene.mesh import Mesh

USUAL_MM = (2.0, 3000.0)
"""Objects that are photographed on a table are this large, across."""
SMALLEST_PIECE = 0.01
"""A piece with less than this share of the largest piece's area is scanner dust."""


def load_scan(path: Path, unit: str, *, ball_diameter_mm: float | None = None) -> Mesh:
    """Read a scan and mend what can be mended; `Mesh.repairs` says what was done.

    Vertices at one place are merged, and those of borders that all but meet; faces without area, double faces, a
    table, a calibration ball, pieces below 1 % of the largest one's area and unused vertices are dropped; faces are
    turned so that neighbours agree, and outward. Holes stay open.

    Parameters
    ----------
    path : Path
        .ply (binary or ASCII, polygons or triangle strips), .obj, .stl, .off, .glb.
    unit : {"m", "cm", "mm", "inch", "unknown"}
        The unit of the file's numbers, whatever its format's standard says.
    ball_diameter_mm : float, optional
        A ball of this diameter is in the scan, apart from the object. It gives the scale where the unit is unknown.

    Returns
    -------
    mesh : Mesh
        Millimetres, in the scan's own frame; in the file's own unit where that is unknown and no ball was
        given. Texture, colour and the file's normals are left behind.

    Raises
    ------
    AlignError
        The file cannot be read, is a point cloud, is empty, holds positions that are no numbers, has not the one
        ball, or is so far from a surface that edges with three and more faces dominate.
    """
    path = Path(path)
    if unit not in UNITS_MM:
        raise AlignError(f"scan_unit: found {unit!r}, expected one of {', '.join(UNITS_MM)}.")
    repairs: list[str] = []
    surface = weld(surface_of(*read_scan(path)), repairs)
    _check_left(path, surface)
    _check_manifold(path, surface, repairs)
    table, words = find_table(surface)
    if words:
        repairs.append(words)
    surface = surface_of(surface.vertices, surface.faces[~table])
    scale = UNITS_MM[unit]
    kept = np.ones(len(surface.faces), bool)
    if ball_diameter_mm is not None:
        kept, radius = _without_ball(path, surface, repairs)
        if unit == "unknown":
            scale = ball_diameter_mm / (2 * radius)
            repairs.append(f"scale from the ball: one unit of the file is {scale:.6g} mm")
        else:
            found = 2 * radius * scale
            repairs.append(f"the ball in the scan measures {found:.4g} mm, {ball_diameter_mm:.4g} mm were said")
    surface = surface_of(surface.vertices, surface.faces[kept & _large(surface, kept, repairs)])
    _check_left(path, surface)
    in_mm = unit != "unknown" or ball_diameter_mm is not None
    _report_borders(surface, scale, "mm" if in_mm else "units of the file", repairs)
    surface = orient(surface, repairs)
    # What a table, a ball or dust leaves behind.
    surface.remove_unreferenced_vertices()
    vertices = np.array(surface.vertices) * scale
    _report_size(vertices, unit, in_mm, repairs)
    return Mesh(vertices, np.array(surface.faces), repairs=tuple(repairs))


def _check_left(path: Path, surface: Any) -> None:
    if len(surface.faces) < 4:
        raise AlignError(f"{path}: only {len(surface.faces)} faces with an area are left of the scan. Export it again.")


def _check_manifold(path: Path, surface: Any, repairs: list[str]) -> None:
    crowded, total = surface.edges_unique[np.bincount(surface.edges_unique_inverse) > 2], len(surface.edges_unique)
    if not len(crowded):
        return
    share = len(crowded) / total
    places = "; ".join(
        f"edge {one}-{two} at ({', '.join(f'{x:.4g}' for x in surface.vertices[[one, two]].mean(0))})"
        for one, two in crowded[:3]
    )
    what = f"{len(crowded)} of {total} edges ({100 * share:.2g} %) have three or more faces: {places}"
    if share > 0.02:
        raise AlignError(
            f"{path}: not the surface of one object: {what}{' ...' if len(crowded) > 3 else ''}. At most 2 % can "
            "be worked with. Repair the scan (for example with MeshLab's 'Repair non manifold edges') and try again."
        )
    repairs.append(f"non-manifold, used as it is: {what}")


def _without_ball(path: Path, surface: Any, repairs: list[str]) -> tuple[NDArray[np.bool_], float]:
    """Return which faces (T,) are not the calibration ball, and its radius in the file's unit."""
    balls, piece = find_balls(surface), pieces_of(surface)
    if len(balls) != 1 or (piece == balls[0][0]).all():
        found = f"balls with diameters {', '.join(f'{2 * r:.4g}' for _, r in balls)}" if balls else "none"
        raise AlignError(
            f"{path}: object.scan_ball_diameter_mm expects one ball apart from the object; found {found}. "
            "Scan the ball with a gap beside the object, or drop the key."
        )
    kept = piece != balls[0][0]
    repairs.append(f"dropped the calibration ball ({(~kept).sum()} faces)")
    return kept, balls[0][1]


def _large(surface: Any, kept: NDArray[np.bool_], repairs: list[str]) -> NDArray[np.bool_]:
    """Return which faces (T,) belong to pieces that are no dust."""
    piece = pieces_of(surface)
    area = np.bincount(piece, np.where(kept, surface.area_faces, 0))
    large = area >= SMALLEST_PIECE * area.max()
    dust = (area > 0) & ~large
    if dust.any():
        repairs.append(f"dropped {dust.sum()} loose pieces ({100 * area[dust].sum() / area.sum():.2g} % of the area)")
    if large.sum() > 1:
        repairs.append(f"kept {large.sum()} separate pieces")
    return large[piece]


def _report_borders(surface: Any, scale: float, unit: str, repairs: list[str]) -> None:
    """Say how many holes and outer borders there are, and how large the largest is."""
    from trimesh.graph import connected_component_labels

    ends = border_of(surface)
    if not len(ends):
        return
    names, index = np.unique(ends, return_inverse=True)
    index, places = index.reshape(-1, 2), scale * np.asarray(surface.vertices)[names]
    loop = connected_component_labels(index, len(names))
    length = np.bincount(loop[index[:, 0]], np.linalg.norm(places[index[:, 0]] - places[index[:, 1]], axis=1))
    across = np.linalg.norm(np.ptp(places[loop == length.argmax()], axis=0))
    repairs.append(
        f"{len(length)} open borders, left open: no truth there; the largest is {length.max():.3g} {unit} long and "
        f"{across:.3g} {unit} across"
    )


def _report_size(vertices: NDArray[np.float64], unit: str, in_mm: bool, repairs: list[str]) -> None:
    """Say so when the unit makes the object a speck or a house."""
    across = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    if not in_mm:
        repairs.append(f"scan_unit is unknown: the scan is {across:.4g} units of its file across")
    elif not USUAL_MM[0] <= across <= USUAL_MM[1]:
        fits = [
            f'"{other}" ({across / UNITS_MM[unit] * factor:.3g} mm)'
            for other, factor in UNITS_MM.items()
            if other != "unknown" and 10 * USUAL_MM[0] <= across / UNITS_MM[unit] * factor <= USUAL_MM[1] / 2
        ]
        repairs.append(
            f'the scan is {across:.3g} mm across: is scan_unit = "{unit}" right?'
            + (f" Usual would be {' or '.join(fits)}" if fits else "")
        )
