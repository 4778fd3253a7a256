"""report.html: its sections, pictures and charts."""
