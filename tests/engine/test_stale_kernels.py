"""An edited kernel is compiled anew, also where only a kernel that calls it is run.

Numba alone does not see that: its cache looks at the file of the function that is
run, not at those of the functions that it calls.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import replay
from replay.kernels import source_hash

PACKAGE = Path(replay.__file__).parent
# Free fall for a second: what comes out is gravity, which stands in another file.
CHILD = """
import numba, numpy as np, replay.kernels
from replay.kernels.strapdown import NAVIGATION_DTYPE, mechanize
nav = np.zeros(1, dtype=NAVIGATION_DTYPE)[0]
nav["r"][0] = 6378137.0
nav["q"][0] = 1.0
for i in range(3):
    nav["C"][i, i] = 1.0
mechanize(nav, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, np.zeros((2, 4)))
stats = mechanize.stats
print(replay.kernels.__file__, float(nav["v"][0]).hex(), numba.config.CACHE_DIR,
      sum(stats.cache_hits.values()))
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the sources that are compiled."""
    target = tmp_path / "replay"
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE / "kernels", target / "kernels", ignore=ignore)
    (target / "log").mkdir()
    for path in [PACKAGE / "__init__.py", *sorted((PACKAGE / "log").glob("_*.py"))]:
        shutil.copy2(path, target / path.relative_to(PACKAGE))
    return target


def fall(package: Path) -> tuple[float, str, int]:
    """Speed after a second, the cache's folder, how much came from it."""
    done = subprocess.run(
        [sys.executable, "-c", CHILD],
        env={
            **os.environ,
            "PYTHONPATH": str(package.parent),
            "NUMBA_CACHE_DIR": str(package.parent / "cache"),
            "PYTHONDONTWRITEBYTECODE": "1",
        },
        cwd=package.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    file, speed, folder, hits = done.stdout.split()
    assert file.startswith(str(package))
    return float.fromhex(speed), folder, int(hits)


def test_edited_callee_in_another_file(package: Path) -> None:
    earth = package / "kernels" / "earth.py"
    text = earth.read_text()
    constant = "GRAVITATIONAL_CONSTANT_M3_S2 = 3.986004418e14"
    assert text.count(constant) == 1
    speed, folder, hits = fall(package)
    assert speed == pytest.approx(-9.78, abs=0.01)
    assert hits == 0
    earth.write_text(text.replace(constant, "GRAVITATIONAL_CONSTANT_M3_S2 = 1.993002209e14"))
    halved, other_folder, hits = fall(package)
    assert halved == pytest.approx(-4.87, abs=0.01)
    assert hits == 0
    assert other_folder != folder
    earth.write_text(text)
    assert fall(package) == (speed, folder, 1)


def test_every_compiled_source_counts(package: Path) -> None:
    before = source_hash(package)
    assert before == source_hash(PACKAGE)
    seen = {before}
    sources = sorted([*package.glob("kernels/*.py"), *package.glob("log/*.py")])
    assert len(sources) > 15
    for path in sources:
        text = path.read_bytes()
        path.write_bytes(text + b"#\n")
        seen.add(source_hash(package))
        path.write_bytes(text)
    assert len(seen) == 1 + len(sources)
    moved = package / "kernels" / "renamed.py"
    (package / "kernels" / "earth.py").rename(moved)
    assert source_hash(package) not in seen
    moved.rename(package / "kernels" / "earth.py")
    assert source_hash(package) == before


def test_what_is_compiled_is_hashed() -> None:
    """A module with a compiled function elsewhere would have a stale cache."""
    hashed = {*PACKAGE.glob("kernels/*.py"), *PACKAGE.glob("log/_*.py")}
    for path in sorted(PACKAGE.rglob("*.py")):
        if path not in hashed:
            assert "njit" not in path.read_text(encoding="utf-8"), path
