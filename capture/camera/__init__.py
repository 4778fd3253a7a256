"""The camera of a session: from session.toml, a board, or EXIF."""
