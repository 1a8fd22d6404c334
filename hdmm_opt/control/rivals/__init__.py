"""Rivals from the literature, one a file: whole laws that need nothing of ours."""
