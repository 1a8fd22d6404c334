"""Enclosures: intervals, and the ranges of expressions over boxes."""
