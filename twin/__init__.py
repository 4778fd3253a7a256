"""Mesh, pose, camera, lights and albedo to rendered Frames; the virtual camera."""
