import copy
import json
import os
from pathlib import Path

import pytest
from forging import forged
from hypothesis import settings

# Timing is no property of the code, and a seed that changes is no test.
settings.register_profile("project", deadline=None, derandomize=True)
settings.load_profile("project")

# Before the workers start: linear algebra on one thread, as in the command line.
for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

GAINS = Path(__file__).parent.parent / "notebooks" / "gains"


@pytest.fixture(scope="session")
def gain_text() -> str:
    """The committed gain file of emla-p2."""
    return (GAINS / "emla-p2.gains.json").read_text(encoding="utf-8")


@pytest.fixture
def document(gain_text: str) -> dict:
    """The same as data, free to be changed."""
    return copy.deepcopy(json.loads(gain_text))


@pytest.fixture(scope="session")
def resealed(gain_text):
    """Text of a changed document with all that it repeats made right again, as a careful forger would."""
    kept = json.loads(gain_text)["obligations"]
    return lambda data: forged(data, kept)
