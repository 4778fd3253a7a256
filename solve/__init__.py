"""Frames and lights to normals and albedo; one file per method."""
