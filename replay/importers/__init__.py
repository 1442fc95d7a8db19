"""Foreign recordings into a log, as a declarative spec says.

A spec (TOML, :mod:`replay.importers.spec`) names files, columns, units, axes,
time scale and lever arms; :func:`import_log` does what it says and nothing else.
The readers give named columns with line numbers; one mapping step turns them
into the rows of a channel. Whatever is skipped, put in order or doubtful is
counted with file and line.
"""

from replay.importers.importer import import_log
from replay.importers.result import ImportResult, update_expected
from replay.importers.spec import Spec
from replay.importers.spec_file import load_spec

__all__ = ["ImportResult", "Spec", "import_log", "load_spec", "update_expected"]
