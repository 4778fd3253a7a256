"""The session's folder: session.toml or another layout, resolved to files."""
