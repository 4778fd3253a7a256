"""The first session.toml: a folder of photographs looked at, what no file tells asked, the rest assumed and said."""
