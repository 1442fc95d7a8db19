"""Logs that the tests of this folder share."""

from tests.engine.drives import short_log, short_run

__all__ = ["short_log", "short_run"]
