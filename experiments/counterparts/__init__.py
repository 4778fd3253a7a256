"""Virtual captures of the seed's real experiments, and their synthetic counterparts."""
