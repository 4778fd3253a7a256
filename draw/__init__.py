"""Charts as SVG, for the report, the other pages and the documentation."""
