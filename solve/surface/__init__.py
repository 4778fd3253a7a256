"""From normals to depth, and to a mesh."""
