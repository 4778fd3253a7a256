"""What normals a set of flashes will give, and which flash to add: before the photographs, from geometry and noise."""
