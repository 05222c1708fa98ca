"""Pushes simulated with contact and friction."""
