"""The object's material, fitted to its photographs."""
