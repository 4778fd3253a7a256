"""Normals without knowing where the lights are."""
