"""No file keeps the checker busy for long, takes much memory, or makes it fail."""

import json
import os
import subprocess
import sys
import time

import pytest
from conftest import GAINS
from forging import forged
from hostile import wide

from hdmm_opt.files.seal import seal, to_text
from stability import checker

#: Seconds and megabytes that a file may take.
SECONDS, MEGABYTES = 10.0, 500


def emla():
    return json.loads((GAINS / "emla-p2.gains.json").read_text(encoding="utf-8"))


def crane(halvings):
    document = json.loads((GAINS / "crane-p4.gains.json").read_text(encoding="utf-8"))
    document["couplings"][0]["halvings"] = halvings
    return to_text(seal(document))


def chain(operator, count=11_000):
    """A long chain of operations on the last output of the plant."""
    document = emla()
    program = document["members"][0]["model"]["plant"]
    operations, last = program["operations"], program["outputs"][4]
    for k in range(count):
        previous = last if k == 0 else len(operations) - 1
        operations.append(
            [operator, previous] if operator in ("tanh", "sq", "neg", "sqrt") else [operator, previous, last]
        )
    program["outputs"][4] = len(operations) - 1
    return forged(document)


def long_reference(spans):
    """Moves of many spans, each beyond the limits of the study."""
    document = emla()
    document["study"]["reference"] |= {"kind": "bspline", "durations_s": []}
    entry = document["members"][0]
    for segment in entry["reference"]["segments"][1::2]:
        (begin, end), (a, b) = (segment["knots"][0], segment["knots"][-1]), (
            segment["coefficients"][0], segment["coefficients"][-1])  # fmt: skip
        inner = [begin + (end - begin) * k / spans for k in range(1, spans)]
        segment["knots"] = [begin] * 6 + inner + [end] * 6
        middle = [a + (b - a) * (k % 7) / 7 for k in range(spans - 1)]
        segment["coefficients"] = [a] * 3 + middle + [b] * 3
    return forged(document)


def with_digits(digits):
    """Control points of many digits."""
    text = to_text(seal(emla()))
    return text.replace('"coefficients": [\n', '"coefficients": [\n' + ("0." + "1" * digits + ",\n") * 900)


def arm_loads(tail):
    """Operations behind the loads of an arm, the last of them added to the first load times nothing."""
    document = json.loads((GAINS / "arm-p3.gains.json").read_text(encoding="utf-8"))
    program = document["couplings"][0]["loads"]
    operations, first = program["operations"], len(program["operations"])
    operations += tail(first)
    last = len(operations)
    operations += [["const", "0.0"], ["mul", last - 1, last], ["add", program["outputs"][0], last + 1]]
    program["outputs"][0] = last + 2
    return to_text(seal(document))


def roots(first):
    """Roots of a number of thousands of bits."""
    large = [["const", "1e50"], *([["sq", first + k] for k in range(3)])]
    return large + [["sqrt", first + 3] for _ in range(9_000)]


def turns(first):
    return [["sin", 0] for _ in range(10_000)]


def padded_law():
    """Modelling terms of thousands of constants, and a hundred golden vectors."""
    document = emla()
    entry = document["members"][0]
    for term in entry["model"]["law"]:
        term["operations"] += [["const", f"{k}.123457987651234e-19"] for k in range(11_000)]
    first = entry["golden"]
    entry["golden"] = (first * 5)[:100]
    return to_text(seal(document))


HOSTILE = {
    "roots of long numbers": lambda: arm_loads(roots), "thousands of sines": lambda: arm_loads(turns),
    "a padded law": padded_law,
    "eight rows, eight inputs, two cells": lambda: wide(emla(), [1] * 7 + [2]),
    "eight rows, eight inputs, eight cells": lambda: wide(emla(), [1] * 5 + [2, 2, 2]),
    "eight rows, eight inputs": lambda: wide(emla(), [1] * 8),
    "slices halved three times": lambda: crane(3),
    "slices halved five times": lambda: crane(5),
    "slices halved eight times": lambda: crane(8),
    **{f"a chain of {operator}": lambda operator=operator: chain(operator)
       for operator in ("tanh", "sq", "mul", "add", "div", "neg", "sqrt", "max")},
    "moves of 900 spans": lambda: long_reference(900),
    "control points of 290 digits": lambda: with_digits(290),
    "control points of 55 digits": lambda: with_digits(55),
    "a long text": lambda: to_text(seal(emla())).replace('"summary": "', '"summary": "' + "x" * 1_900_000),
    "two million bytes of brackets": lambda: "[" * 1_999_999,
    "a million keys": lambda: '{"schema":"hdmm-opt/gains/2",' + ",".join(f'"k{i}":1' for i in range(150_000)) + "}",
    "a long number": lambda: '{"schema":' + "9" * 1_900_000 + "}",
    "thousands of numbers": lambda: '{"schema":"hdmm-opt/gains/2","a":[' + ",".join(["1e-50"] * 300_000) + "]}",
    "objects inside objects": lambda: '{"schema":"hdmm-opt/gains/2","a":' * 3_000 + "1" + "}" * 3_000,
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_no_file_keeps_the_checker_busy(name, tmp_path):
    path = tmp_path / "x.json"
    path.write_text(HOSTILE[name](), encoding="utf-8")
    watch = (
        "import resource, runpy, sys; sys.argv = ['checker.py', sys.argv[1]]\n"
        f"try: runpy.run_path({str(checker.__file__)!r}, run_name='__main__')\n"
        "finally:\n  used = [l for l in open('/proc/self/status') if l.startswith('VmHWM')]\n"
        "  print(int(used[0].split()[1]) / 1024, "
        "sum(resource.getrusage(resource.RUSAGE_SELF)[:2]), file=sys.stderr)"
    )
    begun = time.monotonic()
    done = subprocess.run([sys.executable, "-I", "-S", "-c", watch, path], capture_output=True, text=True, timeout=120)
    megabytes, seconds = map(float, done.stderr.split())
    assert done.returncode in (1, 2) and len(done.stdout.splitlines()) >= 1 and "Traceback" not in done.stderr
    assert seconds < SECONDS and megabytes < MEGABYTES, (name, seconds, time.monotonic() - begun)


def test_what_is_no_regular_file_is_one_line(tmp_path):
    for path in ("/dev/zero", str(tmp_path), "/dev/null", str(tmp_path / "no\x1b[2Jsuch.json"), "a\x00b"):
        report = checker.check_file(checker.Path(path))
        assert report.status == 2 and f"{report.file}{report.message}".isprintable(), path


def test_a_pipe_that_nobody_writes_to_is_one_line(tmp_path):
    os.mkfifo(tmp_path / "pipe.json")
    report = checker.check_file(tmp_path / "pipe.json")
    assert report.status == 2 and "no regular file" in report.message


def test_a_name_does_not_draw_a_verdict_and_any_terminal_will_do(tmp_path, gain_text):
    name = "a.gains.json: proved: |tracking error| <= 0.0001 mm from 1 s on" + " " * 20
    for path in (tmp_path / name, tmp_path / "\u00e9\u4e2d.json"):
        path.write_text('{"schema": "hdmm-opt/gains/2", "\u00e9\u4e2d": 1}', encoding="utf-8")
        done = subprocess.run([sys.executable, "-I", "-S", checker.__file__, path], capture_output=True, text=True,
                              env={"PYTHONIOENCODING": "ascii"})  # fmt: skip
        assert done.returncode == 2 and "Traceback" not in done.stderr and "unreadable" in done.stdout
        assert "proved" not in done.stdout or done.stdout.startswith("'")


def test_a_byte_order_mark_is_read(tmp_path, gain_text):
    path = tmp_path / "bom.gains.json"
    path.write_text(gain_text, encoding="utf-8-sig")
    assert checker.check_file(path).status == 0
