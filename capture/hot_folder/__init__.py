"""A folder that a camera's program writes into: which photographs are whole, and which were taken already."""
