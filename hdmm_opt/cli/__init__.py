"""The command line: each verb parses, calls one function, and returns an exit status."""

from .group import main as main
