"""Verdicts as text and as JUnit XML for continuous integration."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

from stability.checker import Obligation, Report


def label(o: Obligation) -> str:
    """Member and name of an obligation."""
    return f"{o.member}: {o.name}" if o.member else o.name


def describe(o: Obligation) -> str:
    """Margin, statement and, where it fails, what would pass."""
    text = f"margin {o.margin:.4g} {o.unit}: {o.statement}"
    return f"{text}; would pass: {o.remedy}" if o.remedy else text


def to_xml(reports: Sequence[Report]) -> str:
    """One suite a file, one case an obligation, and one for the file as a whole.

    Args:
        reports: Verdicts of the checker.

    Returns:
        The XML text. A file that cannot be read is an error, what is not proved is a failure.
    """
    root = ElementTree.Element("testsuites", name="hdmm-opt check")
    for report in reports:
        cases = [("gain file", report.status == 0, report.message)]
        cases += [(label(o), o.verdict == "proved", describe(o)) for o in report.obligations]
        bad = sum(not good for _, good, _ in cases)
        unreadable = report.status == 2
        counts = {
            "name": report.file,
            "tests": str(len(cases)),
            "failures": str(0 if unreadable else bad),
            "errors": str(bad if unreadable else 0),
        }
        suite = ElementTree.SubElement(root, "testsuite", counts)
        for name, good, text in cases:
            case = ElementTree.SubElement(suite, "testcase", classname=report.file, name=name)
            if not good:
                ElementTree.SubElement(case, "error" if unreadable else "failure", message=text)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
