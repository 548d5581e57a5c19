"""Command line of the package.

Order: options, animate_command, budget_command, compare_command, file_commands, needs_command,
stability_command, study_command, main.
"""

from multiphi_exudyn.cli.main import command, main

__all__ = ["command", "main"]
