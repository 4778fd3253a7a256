"""RAW and other photographs to linear codes, decoded once into a memory-mapped store."""
