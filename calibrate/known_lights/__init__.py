"""Lights from a file: read, put in the photographs' order, checked."""
