import copy
import json
from pathlib import Path

import pytest
from hypothesis import settings

from hdmm_opt import gain_file

# Timing is no property of the code, and a seed that changes is no test.
settings.register_profile("project", deadline=None, derandomize=True)
settings.load_profile("project")

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
def resealed():
    """Text of a changed document with its hashes made right again, as a careful forger would."""
    return lambda data: gain_file.to_text(gain_file.seal(data))
