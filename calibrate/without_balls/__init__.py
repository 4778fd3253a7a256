"""Lights without balls: from given normals, from the object, intensities alone."""
