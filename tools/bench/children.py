"""Whole processes: their time and memory as the kernel counts them.

Memory is read from /proc while the process runs: the `ru_maxrss` of a child counts what its
parent had at the fork too.
"""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

_POLL_S = 0.01
_KIB_PER_MB = 1e6 / 1024.0
_REPLAY = "from replay.cli import main; main()"


@dataclasses.dataclass(frozen=True, slots=True)
class Cost:
    """What a process took.

    Attributes
    ----------
    wall_s, cpu_s : float, s
    resident_mb : float, MB
        Most pages at once, those of mapped files included; 0 where there is no /proc.
    own_mb : float, MB
        Most pages at once without those of files, as seen at hundred looks a second.
    """

    wall_s: float
    cpu_s: float
    resident_mb: float
    own_mb: float


def run_replay(words: Sequence[str], environment: Mapping[str, str] | None = None) -> Cost:
    """Run the command line in a process of its own.

    Raises
    ------
    RuntimeError
        Where it does not end with exit code 0.
    """
    begin = time.perf_counter()
    child = subprocess.Popen(
        [sys.executable, "-c", _REPLAY, *words],
        stdout=subprocess.DEVNULL,
        env={**os.environ, **(environment or {})},
    )
    resident_kib = own_kib = 0
    while True:
        pid, status, usage = os.wait4(child.pid, os.WNOHANG)
        if pid:
            break
        pages = _pages_kib(child.pid)
        resident_kib = max(resident_kib, pages.get("VmHWM", 0))
        own_kib = max(own_kib, pages.get("RssAnon", 0))
        time.sleep(_POLL_S)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        raise RuntimeError(f"replay {' '.join(words)} ended with {child.returncode}")
    return Cost(
        time.perf_counter() - begin,
        usage.ru_utime + usage.ru_stime,
        resident_kib / _KIB_PER_MB,
        own_kib / _KIB_PER_MB,
    )


def _pages_kib(pid: int) -> dict[str, int]:
    """Sizes that the kernel tells of a process, by its names for them."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return {}
    return {name: int(words[0]) for name, *words in map(_words, lines) if words[1:] == ["kB"]}


def _words(line: str) -> list[str]:
    return line.replace(":", " ", 1).split()
