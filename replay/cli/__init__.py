"""The command `replay`: words in, library calls, text and exit codes out."""

from replay.cli.main import main

__all__ = ["main"]
