"""Command line of the package."""

from multiphi_exudyn.cli.main import command, main

__all__ = ["command", "main"]
