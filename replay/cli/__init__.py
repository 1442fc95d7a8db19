"""The command `replay`: words in, library calls, text and exit codes out."""

from replay.cli.app import main

__all__ = ["main"]
