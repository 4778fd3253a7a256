"""A ball's silhouette to hundredths of a pixel."""
