"""Distances and collision between bodies, at rest and along a motion."""
