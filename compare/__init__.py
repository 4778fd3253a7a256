"""Estimates against truth: statistics, pictures, the report."""
