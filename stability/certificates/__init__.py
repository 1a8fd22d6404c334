"""Certificates: one kind a file."""
