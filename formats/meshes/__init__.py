"""PLY, OBJ, STL, OFF, GLB."""
