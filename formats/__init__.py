"""Files that others read and write: light files, normal maps, meshes, session layouts."""
