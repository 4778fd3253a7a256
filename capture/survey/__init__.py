"""A folder of photographs that has no session.toml yet: what each file is."""
