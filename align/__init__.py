"""Scan to camera: pose, object mask, ground-truth normals."""
