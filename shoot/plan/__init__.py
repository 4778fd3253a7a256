"""Before the first flash: what a shoot will give, where the flashes and balls go, and when to stop."""
