"""What colours the camera's own RGB stands for: by a chart that was photographed."""
