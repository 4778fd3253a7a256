"""How bright the lights are: the white ball, the ambient light, the bounce of the table."""
