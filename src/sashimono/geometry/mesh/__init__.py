"""Triangle meshes: measures, topology, boxes, cuts, booleans, equal shapes."""
