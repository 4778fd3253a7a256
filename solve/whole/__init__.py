"""Methods that look at all pixels at once."""
