"""A mesh as binary glTF, which browsers and standard viewers show [Khronos2021].

The camera's frame is glTF's own: x right, y up, z toward the viewer.
"""

from pathlib import Path

from numpy.typing import NDArray

from scene.files import write_whole

METRES_PER_MM = 1e-3
"""glTF counts in metres."""


def write_glb(
    path: Path, vertices: NDArray, faces: NDArray, normals: NDArray, texcoords: NDArray, picture: NDArray
) -> None:
    """Write triangles with a picture on them: no metal, of roughness 1.

    Parameters
    ----------
    path : Path
    vertices, normals : (V, 3)
        Millimetres; unit.
    faces : (T, 3) int
    texcoords : (V, 2)
        Of the picture, 0 to 1: right, and down from the upper edge.
    picture : (h, w, 3) uint8
        sRGB.
    """
    import trimesh
    from PIL import Image
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    material = PBRMaterial(metallicFactor=0.0, roughnessFactor=1.0, baseColorTexture=Image.fromarray(picture))
    mesh = trimesh.Trimesh(METRES_PER_MM * vertices, faces, vertex_normals=normals, process=False)
    # trimesh counts t upward and turns it over as it writes.
    mesh.visual = TextureVisuals(texcoords * [1, -1] + [0, 1], material=material)
    data = mesh.export(file_type="glb")
    assert isinstance(data, bytes)
    with write_whole(path) as file:
        file.write(data)
