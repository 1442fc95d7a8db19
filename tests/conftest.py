"""What every test shares."""

from pathlib import Path

import pytest
from hypothesis import settings

# The first call of a kernel may compile it: a time limit for one example says nothing.
settings.register_profile("replay", deadline=None, print_blob=True)
settings.load_profile("replay")

ROOT = Path(__file__).resolve().parent.parent
SHARED_DATA = ROOT.parent / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real recordings, which are not part of the repository."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"real recordings are not here: {SHARED_DATA}")
    return SHARED_DATA
