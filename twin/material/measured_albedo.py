"""The measured albedo on the scan: the photographs' own pixels as a texture, at their full resolution."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import RenderError
from scene.mesh import Mesh
from scene.normals import filled
from scene.spheres import WHITE_BALL_ALBEDO
from twin.description.materials import Texture
from twin.visibility import Sight

Array = NDArray[np.float64]

BRIGHTEST = 0.98
"""A matte surface gives back less light than it gets."""
BESIDE = 0.8
"""Cosine between a vertex' normal and the picture's there, below which the picture shows another surface."""
SPLIT_PX = 0.1
"""An edge whose middle projects so far from the middle of its projected ends is split."""


def textured_surface(
    sight: Sight, albedo: NDArray, rows: slice, columns: slice
) -> tuple[Mesh, Texture, Array, tuple[str, ...]]:
    """Return the mesh, the measured albedo upon it, the white value (3,), and warnings.

    The seen vertices' normals are `sight.normals` where these are known. Normals at vertices that are added to the
    mesh's are means of its own, shorter than 1: interpolating them gives what interpolating the original mesh would.
    The texture's last rows hold the median, for what the camera does not see.

    albedo (H, W, 3): Pixel value under a light of intensity 1 along the normal; NaN where unknown.
    rows, columns: The box of the picture that holds the mesh.
    Raises RenderError: The albedo is unknown or black wherever the mesh is.

    reflectance = albedo / white value * 0.8, cut to 0 .. 0.98. Faces that the camera does not see get the median.
    """
    warnings: list[str] = []
    camera, white_value = sight.camera, sight.lights.white_value
    measured = np.asarray(albedo[rows, columns], np.float32)
    known: NDArray[np.bool_] = np.isfinite(measured).all(axis=-1)  # type: ignore[assignment]
    if not known.any():
        raise RenderError(
            "the albedo is unknown (NaN) wherever the camera sees the mesh. Check that the pose fits these frames."
        )
    given = np.full(3, np.percentile(measured[known], 99)) if white_value is None else white_value
    white = np.asarray(given, np.float64)
    if white.shape != (3,) or not (np.isfinite(white) & (white > 0)).all():
        raise RenderError(f"the white level of the albedo is {white}; expected 3 positive numbers.")
    scale = WHITE_BALL_ALBEDO / white
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

    vertices, normals, faces = _split_for_perspective(sight.mesh, camera)
    # One row of copies below the picture, then two of the median: bilinear lookup must not mix the two.
    texture[height], texture[height + 1 :] = reflectance[-1], median
    pixels = camera.project(vertices) - [columns.start, rows.start]
    texcoords = (pixels + 0.5) / [width, height + 3]
    # Points outside the picture, or behind the camera, are not seen; a number must stand there all the same.
    texcoords = np.clip(np.nan_to_num(texcoords), 0, [1, (height + 0.5) / (height + 3)])
    seen = replace(sight, mesh=Mesh(vertices, faces)).seen_faces(rows, columns)
    hidden, hidden_normals = faces[~seen], normals
    if sight.normals is not None:
        normals = _pictured(normals, np.unique(faces[seen]), Texture(sight.normals, "clamp"), camera.project(vertices))
    used, local = np.unique(hidden, return_inverse=True)
    faces = np.concatenate([faces[seen], local.reshape(-1, 3) + len(vertices)])
    unseen = np.broadcast_to([0.5, (height + 2.5) / (height + 3)], (len(used), 2))
    textured = Mesh(
        np.concatenate([vertices, vertices[used]]),
        faces,
        np.concatenate([normals, hidden_normals[used]]),
        np.concatenate([texcoords, unseen]),
    )
    return textured, Texture(texture, "clamp"), white, tuple(warnings)


def _pictured(normals: Array, seen: NDArray[np.int64], picture: Texture, pixels: Array) -> Array:
    """Return normals (V, 3), those of vertices that are `seen` as the picture has them at their pixels (V, 2)."""
    out = normals.copy()
    height, width = picture.values.shape[:2]
    found = picture.at((pixels[seen] + 0.5) / [width, height])
    own = np.sum(found * normals[seen], 1) > BESIDE * np.linalg.norm(normals[seen], axis=1)
    out[seen[own]] = found[own]
    return out


def _split_for_perspective(mesh: Mesh, camera: Camera) -> tuple[Array, Array, NDArray[np.int64]]:
    """Split faces until texture coordinates, linear in space, are linear in the picture too."""
    from trimesh.remesh import subdivide

    vertices, faces, normals = mesh.vertices, mesh.faces, {"of": mesh.vertex_normals}
    for _ in range(8):
        turned, pixels = faces[:, [1, 2, 0]], camera.project(vertices)
        middle = camera.project((vertices[faces] + vertices[turned]) / 2)
        miss = np.linalg.norm(middle - (pixels[faces] + pixels[turned]) / 2, axis=-1)
        # Whole faces are split, and their edges' middles lie on the edges: neighbours still fit.
        split = np.flatnonzero((miss > SPLIT_PX).any(1))
        if not len(split) or len(faces) + 3 * len(split) > 4_000_000:
            break
        vertices, faces, normals = subdivide(vertices, faces, split, normals)  # type: ignore[misc]
    return vertices, normals["of"], faces  # type: ignore[return-value]
