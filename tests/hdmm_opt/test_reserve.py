"""What a design bears beyond its assumptions."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from hdmm_opt.files.read import read
from hdmm_opt.files.restore import restored
from hdmm_opt.jobs.certify import contracts_of, strongest
from hdmm_opt.jobs.reserve import reserve_lines
from stability import Failure, Interval

GAINS = Path(__file__).parents[2] / "notebooks" / "gains"


@pytest.fixture(scope="module")
def restoring():
    return restored(read(GAINS / "emla-p2.gains.json"))


def certified(problem, gains, **changes):
    members = tuple(m.under(replace(m.bounds, **changes)) for m in problem.members)
    return not isinstance(contracts_of(replace(problem, members=members), gains, refine=True), Failure)


def test_the_delay_that_is_told_is_certified_and_a_little_more_is_not(restoring):
    problem, gains = restoring
    told, tightest = reserve_lines(problem, gains, strongest(problem, gains).contracts)
    more = float(re.search(r"([0-9.]+) ms more of delay", told)[1]) * 1e-3
    delay, period = problem.members[0].bounds.delay, problem.period
    assert certified(problem, gains, delay=delay + 0.999 * more)
    assert not certified(problem, gains, delay=delay + more + 2 * period / 2**5)
    assert "torque, of which 99" in tightest


def test_what_knows_no_end_says_at_least(restoring):
    problem, gains = restoring
    members = tuple(m.under(replace(m.bounds, noise=tuple(1e-3 * v for v in m.bounds.noise))) for m in problem.members)
    told, _ = reserve_lines(replace(problem, members=members), gains, strongest(problem, gains).contracts)
    assert "measurement errors at least 8 times as large" in told


def test_a_quicker_drive_is_proved_with_the_same_gains():
    """Two poles at zero beside a fast pair: a block of four, whose coordinates must keep its norm below 1."""
    problem, gains = restored(read(GAINS / "emla-p2-encoder.gains.json"))
    quicker = problem.members[0].bounds.parameters | {"drive_lag": Interval(2.4e-4, 3.6e-4)}
    assert certified(problem, gains, parameters=quicker)
