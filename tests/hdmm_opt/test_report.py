"""The report: one page for every machine and for refusals, without script errors, the scale set by what is covered."""

import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from conftest import GAINS

from hdmm_opt.files.animation import frames
from hdmm_opt.files.pictures import OUTSIDE, figure_of, pictures, shares
from hdmm_opt.files.read import read
from hdmm_opt.files.rejected import rejected_document
from hdmm_opt.files.report import write_report
from hdmm_opt.files.restore import restored
from hdmm_opt.files.words import PLAIN
from hdmm_opt.jobs.options import Options, Progress
from hdmm_opt.jobs.pipeline import design
from hdmm_opt.study import load
from stability import checker

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--enable-logging=stderr",
    "--virtual-time-budget=8000", "--dump-dom",
)  # fmt: skip


@pytest.fixture(scope="module")
def documents(tmp_path_factory):
    """A page of one actuator, of a machine, and of a refusal."""
    found = {name: read(GAINS / f"{name}.gains.json") for name in ("emla-p2", "arm-p3")}
    found["emla-refused"] = json.loads(
        json.dumps(rejected_document(design(load("emla-refused"), Options(), Progress())))
    )
    pages = {}
    for name, document in found.items():
        folder = tmp_path_factory.mktemp(name)
        pages[name] = (document, write_report(document, folder))
    return pages


@pytest.mark.parametrize("name", ["emla-p2", "arm-p3", "emla-refused"])
def test_the_page_runs_without_script_errors(name, documents, tmp_path):
    if CHROMIUM is None:
        pytest.skip("no Chromium here; .ci/run installs one")
    _, page = documents[name]
    command = [CHROMIUM, *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert not re.findall(r"CONSOLE.*(?:Uncaught|Error)", done.stderr), done.stderr[-2000:]
    drawn = done.stdout
    assert drawn.count("js-plotly-plot") >= 8 and drawn.count('class="main-svg"') >= 8
    if name == "arm-p3":  # the sticks stand where the run begins
        assert re.search(r'<polyline id="real"[^>]* points="[\d., -]+"', drawn)


def test_the_page_says_the_verdict_first_and_shows_every_limit(documents):
    for name, (document, page) in documents.items():
        text = page.read_text(encoding="utf-8")
        assert text.index('class="verdict') < text.index("<h2>Limits</h2>") < text.index("<h2>Assumptions")
        assert "prefers-color-scheme: dark" in text and "@media print" in text and "break-inside: avoid" in text
        if name == "emla-refused":
            assert "not proved" in text and "Would help" in text and "certified: never more" not in text
            continue
        uses = checker.check_text(json.dumps(document)).uses
        assert text.count('class="certified"') == len(uses)
        for use in uses:
            assert f"{checker.percent(use.share, up=True)} certified" in text


def test_the_assumed_come_first(documents):
    text = documents["emla-p2"][1].read_text(encoding="utf-8")
    rows = re.findall(r'<tr class="(\w+)"><td>(?:actuator: )?[\w ]+\n<td class="n">', text.split("<h2>Assumptions")[1])
    sources = [row for row in rows if row != "study"]
    last = max(k for k, row in enumerate(sources) if row == "assumed")
    assert sources[: last + 1] == ["assumed"] * (last + 1) and len(sources) > last + 1


def test_a_run_outside_the_assumptions_does_not_set_the_scale(documents):
    document, _ = documents["arm-p3"]
    problem, gains = restored(document)
    made = pictures(document, problem, gains)
    outside = [run for run in made.shown if run.kind == "outside"]
    plot = figure_of(made.sections["Error"][0], made.shown)
    low, high = plot.layout.yaxis.range
    bound = made.sections["Error"][0].levels[0][0]
    assert outside and max(float(run.trace.error.max()) for run in outside) * 1e3 > 100 * high
    assert low < bound < high < 2 * bound
    assert [line.line.color for line in plot.data if "outside" in line.name] == [OUTSIDE] * len(outside)
    assert all(share < 1 for share in shares(made.shown, problem).values())


def test_every_error_has_its_certified_bound(documents):
    document, _ = documents["arm-p3"]
    problem, gains = restored(document)
    panels = pictures(document, problem, gains).sections["Error"]
    assert len(panels) == 4 and all("certified bound" in panel.levels[0][2] for panel in panels)


def test_sticks_end_at_the_tool(documents):
    document, _ = documents["arm-p3"]
    problem, _ = restored(document)
    point = [0.3, -1.0, 0.4]
    sticks, place = np.array(problem.machine.sticks(point)), np.array(problem.machine.place(point)).ravel()
    assert sticks.shape[0] == 3 and sticks[:, -1] == pytest.approx(place)
    crane = restored(read(GAINS / "crane-p4.gains.json"))[0].machine
    strokes = [0.2, 0.3, 0.4]
    assert np.array(crane.sticks(strokes))[[0, 2], -1] == pytest.approx(np.array(crane.place(strokes)).ravel())
    emla = restored(documents["emla-p2"][0])[0]
    assert frames(emla, None) is None


def test_every_obligation_has_plain_words():
    assert {name for kinds in checker.REQUIRED.values() for names in kinds.values() for name in names} <= set(PLAIN)
