"""The calibration balls, found in the photographs."""
