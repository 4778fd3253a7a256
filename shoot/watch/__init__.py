"""A shoot under way: each photograph taken once, judged at once, and an ordinary session in the end."""
