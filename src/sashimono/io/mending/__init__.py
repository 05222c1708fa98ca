"""Mending what a file holds: open surfaces, folds, several solids in one mesh."""
