"""What noise does to plain vertex normals, against shaking the mesh itself."""

import numpy as np

from align.scan.scan_noise import plain_normal_gain
from scene.mesh import Mesh
from scene.normals import angular_error_deg


def test_the_gain_is_what_shaking_the_mesh_shows(bumpy):
    """Uneven faces, too: every third vertex of the blob is pulled toward a neighbour."""
    vertices = bumpy.vertices.copy()
    first = bumpy.faces[np.unique(bumpy.faces[:, 0], return_index=True)[1]]
    vertices[first[::3, 0]] += 0.35 * (vertices[first[::3, 1]] - vertices[first[::3, 0]])
    mesh = Mesh(vertices, bumpy.faces)
    gain = plain_normal_gain(mesh)
    generator = np.random.default_rng(10001)
    noise_mm, square = 0.01, np.zeros(len(vertices))
    for _ in range(200):
        height = noise_mm * generator.standard_normal(len(vertices))
        shaken = Mesh(vertices + mesh.vertex_normals * height[:, None], mesh.faces)
        square += np.radians(angular_error_deg(shaken.vertex_normals, mesh.vertex_normals)) ** 2
    ratio = np.sqrt(square / 200) / (noise_mm * gain)
    assert 0.99 < np.median(ratio) < 1.01
    # 200 draws scatter by a twentieth.
    assert np.percentile(ratio, 1) > 0.8
    assert np.percentile(ratio, 99) < 1.2
