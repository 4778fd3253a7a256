"""The scene of fitted materials, and light that reaches a sample by way of the object's other parts, rendered small."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.mesh import Mesh
from twin.description.description import Sampling, TwinScene
from twin.description.materials import Diffuse, Material, RoughPlastic
from twin.description.object_mesh import ObjectMesh
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.material.fit_material import MaterialFit
from twin.material.material_samples import Samples
from twin.scan_scene import scan_scene
from twin.visibility import Sight

SIDE = 112
"""Pixels across the object: light from elsewhere changes slowly."""
SAMPLES, DEPTH = 36, 4


def material_scene(
    sight: Sight,
    fits: tuple[MaterialFit, ...],
    labels: NDArray[np.int8] | None,
    albedo: NDArray[np.float32],
    sampling: Sampling,
) -> tuple[TwinScene, tuple[str, ...]]:
    """Return the scene of a scan made of fitted materials, and what is suspicious about it.

    Parameters and errors: see `twin.scan_scene.scan_scene`; `albedo` (H, W, 3) is that of the fits, of the body.
    `labels` (H, W): which of the fits a pixel is of, -1 where unknown; None if there is but one.

    Notes
    -----
    Of several materials each gets the faces that mostly its pixels see, and those unseen whose nearest seen face is
    its: one object each, with the same normals at the border.
    """
    scene, warnings = scan_scene(sight, albedo, sampling)
    ((name, body),) = scene.materials.items()
    assert isinstance(body, Diffuse)
    # Where the white value is unknown, the scene has taken one.
    made = [_made(fit, body, float(np.mean(scene.white))) for fit in fits]
    if len(made) == 1 or labels is None:
        return replace(scene, materials={name: made[0]}), warnings
    (whole,) = scene.objects
    of_face = _face_labels(replace(sight, mesh=Mesh(whole.mesh.vertices, whole.mesh.faces)), labels, len(fits))
    parts = [(number, np.flatnonzero(of_face == number)) for number in range(len(fits)) if (of_face == number).any()]
    return replace(
        scene,
        materials={f"{name}_{number + 1}": made[number] for number, _ in parts},
        objects=tuple(
            replace(
                whole, name=f"{whole.name}_{number + 1}", material=f"{name}_{number + 1}", mesh=_part(whole.mesh, faces)
            )
            for number, faces in parts
        ),
    ), warnings


def _made(fit: MaterialFit, body: Diffuse, white: float) -> Material:
    if fit.model == "matte":
        return body
    specularity = min(float(np.mean(fit.strength)) / white, 1.0)
    return RoughPlastic(body.reflectance, specularity=specularity, **fit.surface.numbers())


def _face_labels(sight: Sight, labels: NDArray[np.int8], count: int) -> NDArray[np.intp]:
    """Return (T,) the label of most pixels that see a face; of an unseen one, that of the nearest seen one."""
    from scipy.spatial import KDTree

    mesh = sight.mesh
    votes = np.zeros((len(mesh.faces), count), np.intp)
    labelled = np.flatnonzero((labels >= 0).any(1))
    box = slice(int(labelled[0]), int(labelled[-1]) + 1), slice(0, sight.camera.width)
    for rows, face, _, _ in sight.rows(*box):
        hit = (face >= 0) & (labels[rows] >= 0)
        np.add.at(votes, (face[hit], labels[rows][hit]), 1)
    seen = votes.sum(1) > 0
    found = np.argmax(votes, 1)
    middle = mesh.vertices[mesh.faces].mean(1)
    if seen.any() and not seen.all():
        found[~seen] = found[seen][KDTree(middle[seen]).query(middle[~seen])[1]]
    return found


def _part(mesh: ObjectMesh, faces: NDArray[np.intp]) -> ObjectMesh:
    """Return some faces (T,) of a mesh, with the corners that they have."""
    used, corner = np.unique(mesh.faces[faces], return_inverse=True)
    at_corners = (None if a is None else a[used] for a in (mesh.normals, mesh.texcoords, mesh.colours))
    return ObjectMesh(mesh.vertices[used], corner.reshape(-1, 3), *at_corners)


@dataclass(frozen=True, eq=False)
class OnwardLight:
    """Pixel values that come by way of two surfaces or three, rendered small.

    images (F, h, w, 3): Of some of a picture that is `scale` times the camera's.
    row, column: Of that picture, where the images begin.
    """

    images: NDArray[np.float32]
    row: int
    column: int
    scale: float

    def at(self, rows: NDArray, columns: NDArray) -> NDArray[np.float32]:
        """Return (P, F, 3) at pixels (P,) of the camera: bilinear, of lit pixels alone, none of the black beside."""
        row, column = ((place + 0.5) * self.scale - 0.5 for place in (rows, columns))
        return _looked_up(self.images, row - self.row, column - self.column)

    def off(self, samples: Samples) -> Samples:
        """Return samples without that light."""
        return replace(samples, values=samples.values - self.at(samples.rows, samples.columns))


def onward_light(sight: Sight, samples: Samples, albedo: NDArray[np.float32]) -> OnwardLight:
    """Return the light that comes by way of the object's other parts, all of them matte.

    What a highlight throws on another place is left out: narrow as it is, so few paths find it that they would put more
    noise into the samples than they take out.

    albedo (P, 3): Of the samples.
    Raises RenderError: No vectorised variant of Mitsuba runs here; and see `twin.scan_scene.scan_scene`.
    """
    from twin.engines.many import Many
    from twin.engines.variant import import_mitsuba

    import_mitsuba()
    across = max(int(np.ptp(samples.rows)), int(np.ptp(samples.columns))) + 1
    scale = min(1.0, SIDE / across)
    camera = sight.camera
    small = camera.scaled(int(np.ceil(camera.width * scale)), int(np.ceil(camera.height * scale)), scale, scale)
    row, column = ((place + 0.5) * scale - 0.5 for place in (samples.rows, samples.columns))
    sampling, picture = Sampling("many", SAMPLES, DEPTH), _picture(row, column, albedo, small)
    scene, _ = scan_scene(replace(sight, camera=small, normals=None), picture, sampling)
    film = scene.film()
    many = Many(mitsuba_scene(scene), film, scene.lights, max_depth=DEPTH)
    images = many.band(slice(0, film.size[0]), SAMPLES)[1]
    return OnwardLight(images, film.rows.start, film.columns.start, scale)


def _picture(row: NDArray, column: NDArray, albedo: NDArray[np.float32], small: Camera) -> NDArray[np.float32]:
    """Return (H, W, 3), the samples' mean in each small pixel; NaN where there is none."""
    place = np.round(row).astype(int) * small.width + np.round(column).astype(int)
    place = np.clip(place, 0, small.width * small.height - 1)
    count = np.bincount(place, minlength=small.width * small.height)
    total = np.stack([np.bincount(place, albedo[:, c], len(count)) for c in range(3)], -1)
    with np.errstate(invalid="ignore"):
        return (total / count[:, None]).reshape(small.height, small.width, 3).astype(np.float32)


def _looked_up(images: NDArray[np.float32], row: NDArray, column: NDArray) -> NDArray[np.float32]:
    """Return (P, F, 3) of images (F, h, w, 3), bilinear, of lit pixels alone: none of the black behind the object."""
    seen = images.max((0, -1)) > 0
    total, weight = np.zeros((len(images), len(row), 3), np.float32), np.full(len(row), 1e-6, np.float32)
    for down in (0, 1):
        for right in (0, 1):
            i, j = np.floor(row).astype(int) + down, np.floor(column).astype(int) + right
            share = (1 - np.abs(row - i)) * (1 - np.abs(column - j))
            i, j = np.clip(i, 0, seen.shape[0] - 1), np.clip(j, 0, seen.shape[1] - 1)
            share = (share * seen[i, j]).astype(np.float32)
            total += share[:, None] * images[:, i, j]
            weight += share
    return np.moveaxis(total / weight[:, None], 0, 1)
