import copy
import json
from pathlib import Path

import pytest

from hdmm_opt import gain_file

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
