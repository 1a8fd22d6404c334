"""Loops: plant and law as data, and their error rows."""
