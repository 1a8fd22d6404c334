import copy
import json
import os
from pathlib import Path

import pytest
from hypothesis import settings

from hdmm_opt import gain_file
from hdmm_opt.problem import assemble, study_of
from stability import Composition, Gains, certify

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
def composed_text(gain_text: str) -> str:
    """A file of emla-p2 whose certificate is a composition, at gains that leave it room."""
    document = json.loads(gain_text)
    problem = assemble(study_of(document["study"]))
    gains = (
        Gains(beta=24.35, epsilon=1.045, delta=0.4057, sigma=36.09),
        Gains(beta=7188.0, epsilon=7.155, sigma=39.69),
    )
    found = certify(problem.model, problem.bounds, gains, problem.box)
    assert isinstance(found, Composition)
    text, report = gain_file.prove(gain_file.build(problem, gains, found, document["validation"], {}))
    assert report.status == 0
    return gain_file.to_text(text)


@pytest.fixture
def composed(composed_text: str) -> dict:
    """The same as data, free to be changed."""
    return json.loads(composed_text)


@pytest.fixture(scope="session")
def resealed():
    """Text of a changed document with its hashes made right again, as a careful forger would."""
    return lambda data: gain_file.to_text(gain_file.seal(data))
