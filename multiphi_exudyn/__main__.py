"""``python -m multiphi_exudyn``: the command line."""

from multiphi_exudyn.cli import command

if __name__ == "__main__":
    command()
