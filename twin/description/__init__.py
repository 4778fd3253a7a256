"""The scene description, which feeds every engine: its parts, its file, its checks."""
