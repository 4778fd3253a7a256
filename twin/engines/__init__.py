"""The engines that render a scene description, and the choice among them."""
