"""Drawings of plain numbers, as SVG: for pages, notebooks and the documentation. No other room is known."""
