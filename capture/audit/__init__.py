"""What is wrong with a capture: movement, exposure, settings, gamma, missing flashes."""
