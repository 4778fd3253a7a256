"""Errors in numbers, with their uncertainty; whether two captures fail alike."""
