"""The measured albedo on the scan: the photographs' own pixels as a texture, at their full resolution."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import RenderError
from scene.mesh import Mesh
from twin.description.description import WHITE_BALL_ALBEDO
from twin.material.nearest import filled
from twin.visibility import Sight

Array = NDArray[np.float64]

BRIGHTEST = 0.98
"""A matte surface gives back less light than it gets."""
SPLIT_PX = 0.1
"""An edge whose middle projects so far from the middle of its projected ends is split."""


@dataclass(frozen=True)
class Surface:
    """A mesh in the camera frame with a texture.

    vertices, normals (V, 3): Normals: the mesh's vertex normals, or a mean of them at added vertices (then shorter than
        1: interpolating gives what interpolating the original mesh would).
    faces (T, 3).
    texcoords (V, 2): (s, t) in the texture, 0 to 1, t down.
    texture (h, w, 3): Reflectance. The last rows hold the median, for what the camera does not see.
    scale (3,): Reflectance = pixel value * scale.
    """

    vertices: Array
    normals: Array
    faces: NDArray[np.int64]
    texcoords: Array
    texture: NDArray[np.float32]
    scale: Array
    warnings: tuple[str, ...]


def textured_surface(
    mesh: Mesh, camera: Camera, albedo: NDArray, white_value: Array | None, rows: slice, columns: slice
) -> Surface:
    """Return the mesh, given in the camera frame, with the measured albedo upon it.

    albedo (H, W, 3): Pixel value under a light of intensity 1 along the normal; NaN where unknown.
    white_value (3,): The same of the white ball.
    rows, columns: The box of the picture that holds the mesh.
    Raises RenderError: The albedo is unknown or black wherever the mesh is.

    reflectance = albedo / white_value * 0.8, cut to 0 .. 0.98. Faces that the camera does not see get the median.
    """
    warnings: list[str] = []
    measured = np.asarray(albedo[rows, columns], np.float32)
    known: NDArray[np.bool_] = np.isfinite(measured).all(axis=-1)  # type: ignore[assignment]
    if not known.any():
        raise RenderError(
            "the albedo is unknown (NaN) wherever the camera sees the mesh. Check that the pose fits these frames."
        )
    scale = _reflectance_scale(measured[known], white_value)
    height, width = measured.shape[:2]
    texture = np.empty((height + 3, width, 3), np.float32)
    reflectance = np.multiply(measured, scale.astype(np.float32), out=texture[:height])
    if white_value is None:
        warnings.append(
            "The white ball's pixel value is unknown: the brightest albedo (99th percentile) is taken as "
            f"{WHITE_BALL_ALBEDO}, so the strength of the twin's interreflections is a guess."
        )
    bright = float(np.mean((reflectance[known] > BRIGHTEST).any(-1)))
    if bright > 0.01:
        warnings.append(
            f"{100 * bright:.1f} % of the object's pixels have an albedo above {BRIGHTEST} (white ball: "
            f"{WHITE_BALL_ALBEDO}), more than matte surfaces give back; they are rendered with {BRIGHTEST}."
        )
    np.clip(filled(reflectance, known), 0, BRIGHTEST, out=reflectance)
    median = np.median(reflectance[known], 0)

    vertices, normals, faces = _split_for_perspective(mesh, camera)
    # One row of copies below the picture, then two of the median: bilinear lookup must not mix the two.
    texture[height], texture[height + 1 :] = reflectance[-1], median
    pixels = camera.project(vertices) - [columns.start, rows.start]
    texcoords = (pixels + 0.5) / [width, height + 3]
    # Points outside the picture, or behind the camera, are not seen; a number must stand there all the same.
    texcoords = np.clip(np.nan_to_num(texcoords), 0, [1, (height + 0.5) / (height + 3)])
    seen = Sight(Mesh(vertices, faces), camera).seen_faces(rows, columns)
    hidden = faces[~seen]
    used, local = np.unique(hidden, return_inverse=True)
    faces = np.concatenate([faces[seen], local.reshape(-1, 3) + len(vertices)])
    unseen = np.broadcast_to([0.5, (height + 2.5) / (height + 3)], (len(used), 2))
    return Surface(
        np.concatenate([vertices, vertices[used]]),
        np.concatenate([normals, normals[used]]),
        faces,
        np.concatenate([texcoords, unseen]),
        texture,
        scale,
        tuple(warnings),
    )


def _reflectance_scale(measured: NDArray, white_value: Array | None) -> Array:
    """Return (3,) what turns albedo (P, 3) in pixel values into reflectance."""
    if white_value is None:
        white_value = np.full(3, np.percentile(measured, 99))
    white_value = np.asarray(white_value, np.float64)
    if white_value.shape != (3,) or not (np.isfinite(white_value) & (white_value > 0)).all():
        raise RenderError(f"the white level of the albedo is {white_value}; expected 3 positive numbers.")
    return WHITE_BALL_ALBEDO / white_value


def _split_for_perspective(mesh: Mesh, camera: Camera) -> tuple[Array, Array, NDArray[np.int64]]:
    """Split faces until texture coordinates, linear in space, are linear in the picture too."""
    vertices, normals, faces = mesh.vertices, mesh.vertex_normals, mesh.faces
    for _ in range(8):
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), 1)
        unique, which = np.unique(edges, axis=0, return_inverse=True)
        ends = vertices[unique]
        middle = ends.mean(1)
        miss = np.linalg.norm(camera.project(middle) - camera.project(ends).mean(1), axis=-1)
        # Whole faces are split, and their edges' middles lie on the edges: neighbours still fit.
        split = (miss > SPLIT_PX)[which].reshape(-1, 3).any(1)
        if not split.any() or len(faces) + 3 * np.count_nonzero(split) > 4_000_000:
            break
        edge_of = which.reshape(-1, 3)[split]
        added, local = np.unique(edge_of, return_inverse=True)
        ab, bc, ca = (local.reshape(-1, 3) + len(vertices)).T
        a, b, c = faces[split].T
        quarters = [np.stack(corners, 1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        normals = np.concatenate([normals, normals[unique[added]].mean(1)])
        vertices = np.concatenate([vertices, middle[added]])
        faces = np.concatenate([faces[~split], *quarters])
    return vertices, normals, faces
