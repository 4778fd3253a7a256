"""Session folder to Frames: manifest, decoding, audit."""
