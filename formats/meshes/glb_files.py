"""A surface with its picture as binary glTF, which browsers and standard viewers show."""

from pathlib import Path

from numpy.typing import NDArray

from scene.files import write_whole

METRES_PER_MM = 1e-3
"""glTF counts in metres [Khronos2021]."""


def write_glb(
    path: Path, vertices: NDArray, normals: NDArray, faces: NDArray, texcoords: NDArray, picture: NDArray
) -> None:
    """Write a matte surface; the camera's frame is glTF's own: x right, y up, z toward the viewer.

    Parameters
    ----------
    vertices, normals : (V, 3)
        Millimetres; unit.
    faces : (T, 3) int
    texcoords : (V, 2)
        Of the picture, 0 to 1: right, and down from its upper edge.
    picture : (h, w, 3) uint8
        sRGB.
    """
    import trimesh
    from PIL import Image
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    # As trimesh has it, v is upward.
    material = PBRMaterial(baseColorTexture=Image.fromarray(picture), metallicFactor=0.0, roughnessFactor=1.0)
    mesh = trimesh.Trimesh(
        METRES_PER_MM * vertices, faces, vertex_normals=normals, process=False,
        visual=TextureVisuals(texcoords * [1, -1] + [0, 1], material=material),
    )  # fmt: skip
    data = mesh.export(file_type="glb", include_normals=True)
    assert isinstance(data, bytes)
    with write_whole(path) as file:
        file.write(data)
