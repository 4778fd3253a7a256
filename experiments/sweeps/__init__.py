"""Sweeps: one factor at a time from easy to hard, every method, known truth."""
