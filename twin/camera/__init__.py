"""The virtual camera: a linear image becomes a RAW photograph."""
