"""The catalogue: named datasets made on demand, newcomers checked and added, and every method run on them."""
