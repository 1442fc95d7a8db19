"""The same log gives the same bytes in any process: a fresh one for each circumstance.

Differences between libraries were seen to begin after 18 minutes of a drive, so the
drive here is longer: 25 minutes at 200 Hz.
"""

from __future__ import annotations

import functools
import json
import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.engine.drives import FULL, OUTPUTS, long_drive

ROOT = Path(__file__).parents[2]
SETTINGS = {
    **FULL,
    "gnss": {"latency": 0.05, "position_gate": 16.0, "rejections": 3},
    "stops": {"zero_velocity": True, "zero_rate": True},
}
# Prints what came out, and what the process was, so that a test can tell that the
# circumstance it asked for was there.
CHILD = """
import ctypes, hashlib, json, math, struct, sys
import numba
from numba.core.registry import cpu_target
from replay.engine.job import make_job
from replay.engine.replayer import Replayer
from replay.engine.sink import DigestSink
from replay.log.reader import LogReader

with LogReader(sys.argv[1]) as reader:
    job = make_job(reader, "gnss-ins-lc", tables=[json.loads(sys.argv[2])])
    result = Replayer(reader, job).run(DigestSink())
libm = hashlib.sha256()
for k in range(1, 100_000):
    libm.update(struct.pack("<dd", math.sin(0.37 * k), math.exp(-1e-4 * k)))
_, name, features = cpu_target.target_context.codegen().magic_tuple()
print(json.dumps({
    "digests": {topic: d.sha256 for topic, d in result.outputs.items()},
    "counts": {topic: d.message_count for topic, d in result.outputs.items()},
    "libm": libm.hexdigest(),
    "hash": hash("replay"),
    "threads": numba.config.NUMBA_NUM_THREADS,
    "cpu": name,
    "features": features,
    "numpy": [n for n, on in __import__("numpy")._core._multiarray_umath.__cpu_features__.items()
              if on],
}))
"""


@functools.cache
def child(log: Path, **environment: str) -> dict[str, Any]:
    """What a fresh process says after a replay of `log`."""
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(log), json.dumps(SETTINGS)],
        env={**os.environ, **environment},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=1200,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    path = tmp_path_factory.mktemp("long") / "in.mcap"
    assert long_drive(path) >= 25 * 60
    yield path
    path.unlink()


@pytest.fixture(scope="module")
def plain(log: Path) -> dict[str, Any]:
    """A replay in an ordinary process."""
    answer = child(log, PYTHONHASHSEED="0")
    assert sorted(answer["digests"]) == OUTPUTS
    for topic, count in answer["counts"].items():
        assert count > 15, topic
    assert answer["counts"]["/solution/gnss-ins-lc"] > 15_000
    return answer


@pytest.mark.parametrize("seed", ["1", "random"])
def test_hash_seed(log: Path, plain: dict[str, Any], seed: str) -> None:
    other = child(log, PYTHONHASHSEED=seed)
    assert other["hash"] != plain["hash"]
    assert other["digests"] == plain["digests"]


@pytest.mark.parametrize("threads", ["1", "2", "4"])
def test_number_of_threads(log: Path, plain: dict[str, Any], threads: str) -> None:
    names = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    other = child(log, **dict.fromkeys(names, threads))
    assert other["threads"] == int(threads)
    assert other["digests"] == plain["digests"]


@pytest.mark.skipif(platform.machine() != "x86_64", reason="AVX2 and FMA are of x86-64")
def test_libm_without_fused_multiply_add(log: Path, plain: dict[str, Any]) -> None:
    """Glibc then picks other variants of sin and exp, which differ in the last bit."""
    # The names are AVX2 and FMA since glibc 2.33, AVX2_Usable and FMA_Usable before.
    off = "-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable,-FMA4_Usable"
    other = child(log, GLIBC_TUNABLES=f"glibc.cpu.hwcaps={off}")
    if "fma" in Path("/proc/cpuinfo").read_text().split() and platform.libc_ver()[0] == "glibc":
        assert other["libm"] != plain["libm"], "the tunable did not take effect"
    assert other["digests"] == plain["digests"]


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the names are of x86-64")
def test_numpy_without_wide_vectors(log: Path, plain: dict[str, Any]) -> None:
    wide = [name for name in plain["numpy"] if name.startswith(("AVX", "FMA", "F16C", "X86_V"))]
    # What numpy was built for cannot be switched off, and it says so.
    import numpy as np

    dispatched = set(np._core._multiarray_umath.__cpu_dispatch__)
    names = [name for name in wide if name in dispatched]
    other = child(log, NPY_DISABLE_CPU_FEATURES=" ".join(names))
    assert not set(names) & set(other["numpy"])
    assert other["digests"] == plain["digests"]


@pytest.mark.skipif(platform.machine() != "x86_64", reason="host and generic are alike elsewhere")
def test_generic_processor(log: Path, plain: dict[str, Any], tmp_path: Path) -> None:
    """Compiled anew for any x86-64: no AVX, no FMA, other register allocation."""
    other = child(log, NUMBA_CPU_NAME="generic", NUMBA_CACHE_DIR=str(tmp_path))
    assert (other["cpu"], other["features"]) == ("generic", "")
    assert plain["cpu"] != "generic"
    assert list(tmp_path.rglob("*.nbc")), "nothing was compiled here"
    assert other["digests"] == plain["digests"]
