"""Executors: one a file."""
