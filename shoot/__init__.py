"""Before and during a shoot: the first session.toml (init), where to stand (plan), a folder that fills (watch)."""
