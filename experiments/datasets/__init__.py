"""The catalogue: named datasets made on demand, newcomers added, and every method run on them."""
