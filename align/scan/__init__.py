"""The scan as the scanner wrote it: mended, with normals and their sigma."""
