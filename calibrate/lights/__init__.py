"""Where the lights are: highlights, directions and positions, one adjustment with its covariance."""
