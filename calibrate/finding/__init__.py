"""Where the balls are: candidates, their kind, their outlines."""
