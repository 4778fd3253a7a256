"""Lights read from, and written to, the files of other tools."""
