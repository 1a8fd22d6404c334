import copy
import json
import os
from fractions import Fraction
from pathlib import Path

import pytest
from forging import forged
from hypothesis import settings

from hdmm_opt.files.gain_file import build
from hdmm_opt.files.restore import restored
from hdmm_opt.files.seal import prove, to_text
from hdmm_opt.files.sections import stated_ultimate
from hdmm_opt.simulation import Loop
from stability import Composition, certify
from stability.networks.contracts import Contract

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
    problem, _ = restored(document)
    (member,) = problem.members
    values = (24.35, 1.045, 0.4057, 36.09, 7188.0, 7.155, 1.0, 39.69)
    found = certify(member.model, member.bounds, member.gains(values), member.box)
    assert isinstance(found, Composition)
    contracts = {"actuator": Contract(guarantee=None, reached=None, bounds=member.bounds, certificate=found)}
    shown = document["validation"]
    ultimate = float(Fraction(stated_ultimate(contracts["actuator"])))
    shown["requirements"][0]["certified"] = ultimate * (1 + 1e-15)
    text, report = prove(build(Loop(problem), {"actuator": values}, contracts, shown))
    assert report.status == 0, report.message
    return to_text(text)


@pytest.fixture
def composed(composed_text: str) -> dict:
    """The same as data, free to be changed."""
    return json.loads(composed_text)


@pytest.fixture(scope="session")
def resealed(gain_text, composed_text):
    """Text of a changed document with all that it repeats made right again, as a careful forger would."""
    kept = [json.loads(text)["obligations"] for text in (gain_text, composed_text)]
    return lambda data: forged(data, kept[1] if data["obligations"] == kept[1] else kept[0])
