import json
import os
import tomllib
from pathlib import Path

import pytest
from forging import forged
from hypothesis import settings
from machines import study_from

# Timing is no property of the code, and a seed that changes is no test.
settings.register_profile("project", deadline=None, derandomize=True)
settings.load_profile("project")

# Before the workers start: linear algebra on one thread, as in the command line.
for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

GAINS = Path(__file__).parent.parent / "notebooks" / "gains"


#: Smaller gains than the committed ones of emla-p2, which a certificate of few cells is enough for.
SMALLER = {"beta_1": 60.0, "beta_2": 18000.0, "gamma_2": 4e5}


def cheap(name: str, change, gains: dict[str, float]) -> str:
    """A gain file of a changed study with few cells: the committed gains, but for some."""
    from hdmm_opt.files.seal import to_text
    from hdmm_opt.files.state import State
    from hdmm_opt.jobs.certify import contracts_of
    from hdmm_opt.jobs.options import Options, Progress, effort_of
    from hdmm_opt.jobs.pipeline import finished
    from hdmm_opt.jobs.start import Tuned
    from hdmm_opt.problem import assemble
    from hdmm_opt.study.read import bundled_text

    data = tomllib.loads(bundled_text(name))
    change(data)
    problem = assemble(study_from(data))
    chosen = {}
    committed = json.loads((GAINS / f"{name}.gains.json").read_text(encoding="utf-8"))["members"]
    for member, entry in zip(problem.members, committed, strict=True):
        given = {gain["name"]: gain["value"] for gain in entry["gains"]} | gains
        chosen[member.name] = tuple(min(max(given[item.name], item.low), item.high) for item in member.ranges)
    contracts = contracts_of(problem, chosen)
    made = finished(
        problem, Tuned(gains=chosen, contracts=contracts, evaluations=0), contracts,
        effort_of(problem.study, Options()), Options(), State(None, {}, resume=False), Progress(), 0.0, kept={},
    )  # fmt: skip
    assert made.document is not None, made.verdicts
    return to_text(made.document)


@pytest.fixture(scope="session")
def gain_text() -> str:
    """A gain file of emla-p2 that is decided in a fraction of the time of the committed one."""

    def quicker(data):
        data["plant"]["parameters"]["drive_lag"] = {"value": 3e-4, "unit": "s", "tolerance": 0.05, "source": "assumed"}

    return cheap("emla-p2", quicker, SMALLER)


@pytest.fixture(scope="session")
def arm_text() -> str:
    """The same of arm-p3, whose joints may push a little more."""

    def stronger(data):
        data["plant"]["joints"]["lift"]["limits"]["torque"]["value"] = 5e4

    return cheap("arm-p3", stronger, {})


@pytest.fixture
def document(gain_text: str) -> dict:
    """The same as data, free to be changed."""
    return json.loads(gain_text)


@pytest.fixture(scope="session")
def resealed(gain_text):
    """Text of a changed document with all that it repeats made right again, as a careful forger would."""
    kept = json.loads(gain_text)["obligations"]
    return lambda data: forged(data, kept)
