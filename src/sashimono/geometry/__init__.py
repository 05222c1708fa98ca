"""Rigid motions, meshes, directions, distances: what all three levels stand on."""
