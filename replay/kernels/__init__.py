"""Compiled arithmetic: arrays in, arrays out, the same bits on every machine.

Kernels import numpy and numba alone. Allowed are + - × ÷, sqrt, floor, integer
operations and comparisons, in a written order; sin, cos and their kin come from
:mod:`replay.kernels.elementary`. Not allowed are fastmath, parallel reductions,
BLAS (`@`, `np.dot`, `np.linalg`), `**` and libm.

Importing this package chooses the folder of numba's cache. Its name holds a hash
of every source that is compiled, because numba notices an edited function but
not an edited function that it calls in another file, and would go on with the
old machine code.
"""

import hashlib
import os
from pathlib import Path

import llvmlite
import numba
import numpy as np

_PACKAGE = Path(__file__).resolve().parent.parent


def source_hash(root: Path = _PACKAGE) -> str:
    """Hash of all compiled sources and of the compiler's version.

    Parameters
    ----------
    root : Path
        Folder of the package `replay`.

    Returns
    -------
    str
        16 hexadecimal digits.
    """
    digest = hashlib.sha256()
    for version in (numba.__version__, llvmlite.__version__, np.__version__):
        digest.update(version.encode())
    for path in sorted([*root.glob("kernels/*.py"), *root.glob("log/_*.py")]):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> str:
    base = os.environ.get("NUMBA_CACHE_DIR")
    if base is None:
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        base = str(home / "gnss-ins-replay")
    return str(Path(base) / source_hash())


# numba fills its settings in at run time, so a type checker does not know this one.
setattr(numba.config, "CACHE_DIR", _cache_folder())  # noqa: B010
