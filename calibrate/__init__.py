"""Frames to balls and lights."""
