"""Strengths without a white ball: from the object itself."""
