"""The scan's pose: start, registration, refinement, uncertainty."""
