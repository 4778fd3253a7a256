"""A folder of photographs without a session.toml: what was found is shown, put right by hand, and written."""
