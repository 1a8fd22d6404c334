"""Machines: one a file, with a `MODEL`; rigid bodies, URDF, geometry."""
