"""Motions: references of machines."""
