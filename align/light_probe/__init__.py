"""Lights from the shading of a scan, where no ball and no file tells them: pose and lights together."""
