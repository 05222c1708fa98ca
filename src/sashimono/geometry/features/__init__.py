"""Features of CAD parts: directions, axes, threads."""
