"""The command: files in, verdicts out."""

from __future__ import annotations

import argparse
import io
import json
import os
import stat
import sys
import textwrap
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from .arithmetic import WORK
from .coupling import Coupling, guarantees_kept
from .grammar import shaped
from .limits import (
    MAX_BYTES,
    MAX_COUPLED,
    MAX_MEMBERS,
    MAX_PRODUCTS,
    NAME,
    SCHEMA,
    NotProvedError,
    UnreadableError,
    need,
)
from .member import Member, check_member
from .obligation import Obligation, Report, above, downward, milli, percent, upward
from .parsing import check_digests, number, parse, wrong_schema
from .requirements import beyond_error
from .shared import drawn_together
from .statement import met
from .watch import quiet


def check_text(text: str, file: str = "", *, recorded: bool = True) -> Report:
    """Re-prove a gain file given as text.

    Args:
        text: The file.
        file: Its name, for the report.
        recorded: Whether what the file records of the obligations must be what is found.

    Returns:
        Status 0 proved, 1 not proved, 2 unreadable; with one line and the obligations.
    """
    try:
        data = parse(text)
        need(data.get("schema") == SCHEMA, wrong_schema(data.get("schema")))
        shaped(data)
        check_digests(text)
        report = check_machine(data, file, recorded)
        differs = remembered(data, report) if recorded and not report.status else ""
        return replace(report, status=1, message=f"not proved: {differs}") if differs else report
    except UnreadableError as error:
        return Report(file, 2, f"unreadable: {error}")
    except NotProvedError as error:
        return Report(file, 1, f"not proved: {error}")
    except RecursionError:
        return Report(file, 2, "unreadable: the file is nested too deeply")
    except (KeyError, TypeError, AttributeError, IndexError, ValueError, ArithmeticError) as error:
        return Report(file, 2, f"unreadable: a part of the gain file is missing or malformed: {error!r:.120}")


def remembered(data: dict[str, Any], report: Report) -> str:
    """What the file records otherwise than it is found; empty where nothing."""
    told = data["obligations"]
    for found, row in zip(report.obligations, told, strict=False):
        for key in ("name", "member", "statement", "unit", "verdict"):
            if row.get(key) != getattr(found, key):
                return f"the file records another {key} of {found.name}"
        if not isinstance(row.get("margin"), Fraction) or float(row["margin"]) != found.margin:
            return f"the file records another margin of {found.name}"
    if len(told) < len(report.obligations):
        return f"the file leaves out the obligation {report.obligations[len(told)].name}"
    return "" if len(told) == len(report.obligations) else "the file records an obligation that there is not"


def check_machine(data: dict[str, Any], file: str, recorded: bool = True) -> Report:
    """Re-prove each member by itself, then what the members assume of each other."""
    names = [entry["name"] for entry in data["members"]]
    need(0 < len(names) <= MAX_MEMBERS and len(set(names)) == len(names), f"a machine has 1 to {MAX_MEMBERS} members")
    need(all(isinstance(name, str) and NAME.fullmatch(name) for name in names), "a member's name must be an identifier")
    need(set(names) == set(data["study"]["plant"]["joints"]), "the members are not those of the study")
    study, states = data["study"], {row["state"] for entry in data["members"] for row in entry["model"]["rows"]}
    for where, given, known in (
        ("controller.members", study["controller"]["members"], set(names)),
        ("controller.rates_hz", study["controller"].get("rates_hz", {}), set(names)),
        ("requirements.member_error", study["requirements"].get("member_error", {}), set(names)),
        ("uncertainty.noise", study["uncertainty"].get("noise", {}), states),
        ("uncertainty.resolution", study["uncertainty"].get("resolution", {}), states),
        ("uncertainty.initial", study["uncertainty"].get("initial", {}), states),
    ):
        need(set(given) <= known, f"the study's {where} names something that the file does not have")
    need(list(study["plant"]["joints"]) == names, "the members stand in another order than in the study")
    need(not set(study["plant"]["locked"]) & set(names), "a member that moves is not locked")
    couplings = data["couplings"]
    need(isinstance(couplings, list) and len(couplings) <= 1, "a machine has one coupling, or none")
    need(all(entry["members"] == names for entry in couplings), "a coupling is of all members in their order")
    made: list[Obligation] = []
    WORK.begin(MAX_PRODUCTS)
    members = []
    for which in range(len(names)):
        if not couplings:  # each is by itself, and costs what a file of its own would
            WORK.begin(MAX_PRODUCTS)
        member = check_member(data, which, bool(couplings))
        made += member.made
        if member.failed:
            where = f"{member.name}: " if len(names) > 1 else ""
            return Report(file, 1, f"not proved: {where}{member.failed}", made)
        members.append(member)
    return check_together(data, members, made, file, recorded)


def check_together(
    data: dict[str, Any], members: list[Member], made: list[Obligation], file: str, recorded: bool
) -> Report:
    """What joins the members: guarantees and coupling; and the bound on the output."""
    WORK.begin(MAX_COUPLED)
    if data["couplings"]:
        made.append(guarantees_kept(data, members))
    coupling = Coupling(data, data["couplings"][0], members) if data["couplings"] else None
    made += coupling.obligations() if coupling is not None else []
    made += [*drawn_together(data, members), *quiet(data, members)]
    wrong = [o for o in made if o.verdict != "proved"]
    if wrong:
        text = f"{wrong[0].name} (margin {downward(wrong[0].margin)} {wrong[0].unit})"
        return Report(file, 1, f"not proved: {text}", made)
    units = {str(member.claim.rows[0]["unit"]) for member in members}
    need(coupling is not None or len(units) == 1, "the first states of members without a coupling have one unit")
    worst = max(member.claim.ultimate[0] for member in members)
    proved = {"tracking_error_m": worst if coupling is None else coupling.stated}
    if len(members) > 1:
        proved |= {f"member_error.{m.name}": m.claim.ultimate[0] for m in members}
    proved |= beyond_error(data, members, coupling)
    records = ""
    written, required = {name: above(bound) for name, bound in proved.items()}, {}
    for row in data["validation"]["requirements"]:
        required[row["name"]] = float(row["required"]), written.get(row["name"])
        if not recorded:
            row["certified"] = Fraction(written[row["name"]]) if row["name"] in written else None
    try:
        met(data, proved)
    except UnreadableError as error:
        if recorded:
            raise
        records = str(error)
    reach = [member.claim.half_widths[0] for member in members]
    inside = max(reach) if coupling is None else coupling.output(reach)
    need(0 <= number(data["validation"]["largest_error_m"], "largest_error_m"), "an error must not be negative")
    if number(data["validation"]["largest_error_m"], "largest_error_m") > inside:
        return Report(file, 1, "not proved: the recorded simulation leaves the certified envelope", made)
    settled = upward(members[0].claim.transient, 6)
    bound = milli(proved["tracking_error_m"], units.pop() if coupling is None else "m")
    of = "" if len(members) == 1 else f" of each of {len(members)} members"
    of = of if coupling is None else f" of the output, all {len(members)} members together"
    message = f"proved: |tracking error{of}| <= {bound} from {settled} s on"
    used = [use for member in members for use in member.used]
    return Report(file, 0, message, made, used, *unsourced(data), data["study"]["plant"]["model"], records, required)


def unsourced(data: dict[str, Any]) -> tuple[list[str], list[str]]:
    """What the study left to the bundled machine, and what is assumed."""
    joints = data["study"]["plant"]["joints"]
    bundled, assumed = [], []
    for member, section in joints.items():
        before = f"{member}." if len(joints) > 1 else ""
        bundled += [before + name for name in section.get("bundled", [])]
        for kind, after in (("parameters", ""), ("ratings", ""), ("limits", " limit")):
            entries = section.get(kind, {}).items()
            assumed += [before + name + after for name, entry in entries if entry["source"] == "assumed"]
    body = data["study"]["plant"].get("body", {}).items()
    assumed += [f"body.{name}" for name, entry in body if entry["source"] == "assumed"]
    return bundled, assumed


def check_file(path: Path) -> Report:
    """Re-prove one file."""
    shown = plainly(str(path))
    shown = shown if len(shown.split()) <= 1 and ": " not in shown else repr(" ".join(shown.split()))
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        with os.fdopen(handle, "rb") as stream:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                return Report(shown, 2, "unreadable: it is no regular file")
            content = stream.read(MAX_BYTES + 1)
        if len(content) > MAX_BYTES:
            return Report(shown, 2, f"unreadable: a gain file has at most {MAX_BYTES} bytes")
        return check_text(content.decode("utf-8-sig"), shown)
    except UnicodeDecodeError:
        return Report(shown, 2, "unreadable: it is not UTF-8 text")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "no such file"
        return Report(shown, 2, f"unreadable: {reason}")


def plainly(text: str) -> str:
    """Text without anything that a terminal would not print as it stands."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def main(arguments: list[str] | None = None) -> int:
    """Check files: for each a verdict, with -v one line an obligation."""
    parser = argparse.ArgumentParser(description="Re-prove gain files from the files alone.")
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--json", action="store_true", help="print the verdicts as JSON")
    parser.add_argument("-v", "--verbose", action="store_true", help="show every obligation")
    options = parser.parse_args(arguments)
    reports = [check_file(path) for path in options.files]
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        show(reports, as_json=options.json, verbose=options.verbose)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return max(report.status for report in reports)


def show(reports: list[Report], *, as_json: bool, verbose: bool = False) -> None:
    """Print the verdicts."""
    if as_json:
        kinds = ("obligations", "uses")
        rows = [{**r.__dict__, **{k: [e.__dict__ for e in getattr(r, k)] for k in kinds}} for r in reports]
        print(json.dumps(rows, indent=1))
        return
    for report in reports:
        print(f"{report.file}: {plainly(report.message)}")
        for line in (*limit_lines(report), *requirement_lines(report), *source_lines(report)):
            print(f"  {line}")
        for line in obligation_lines(report, everything=verbose):
            print(f"  {line}")


def limit_lines(report: Report) -> list[str]:
    """What is certified of the limits, in lines of a terminal."""
    members = list(dict.fromkeys(use.member for use in report.uses))
    alike: dict[str, list[str]] = {}
    for member in members:
        shares = ", ".join(f"{u.name} {percent(u.share, up=True)}" for u in report.uses if u.member == member)
        alike.setdefault(shares, []).append(member)
    lines = []
    for shares, own in alike.items():
        before = f"{', '.join(own)}: " if len(members) > 1 else ""
        lines += wrapped(f"{before}of its limits at most: {shares}")
    return lines


def requirement_lines(report: Report) -> list[str]:
    """Which requirements are proved, and which are met in simulation only, in lines of a terminal."""
    proved = [
        f"{name} {upward(Fraction(b))} of {limit:g}" for name, (limit, b) in report.required.items() if b is not None
    ]
    seen = [name for name, (_, bound) in report.required.items() if bound is None]
    lines = wrapped(f"proved of what is required: {', '.join(proved)}") if proved else []
    return lines + (wrapped(f"required and simulated only: {', '.join(seen)}") if seen else [])


def source_lines(report: Report) -> list[str]:
    """What the numbers rest on, in lines of a terminal."""
    whose = f"the defaults of {report.model}" if ".py" in report.model else f"of the bundled {report.model}"
    members = list(dict.fromkeys(use.member for use in report.uses))
    lines = wrapped(f"still {whose}: {gathered(report.bundled, members)}") if report.bundled else []
    return lines + (wrapped(f"assumed: {gathered(report.assumed, members)}") if report.assumed else [])


def gathered(names: list[str], members: list[str]) -> str:
    """Names of numbers, each once with the members in brackets that have it."""
    found: dict[str, list[str]] = {}
    for name in names:
        owner, _, key = name.rpartition(".")
        found.setdefault(key, []).append(owner)
    return ", ".join(
        key if own == [""] else f"{key} ({'all' if own == members else ', '.join(own)})" for key, own in found.items()
    )


def obligation_lines(report: Report, *, everything: bool) -> list[str]:
    """Obligations, all or those that fail, in lines of a terminal."""
    many = len({o.member for o in report.obligations if o.member}) > 1
    lines = []
    for o in report.obligations:
        if everything or o.verdict != "proved":
            name = f"{o.member}: {o.name}" if many and o.member else o.name
            unit = "" if o.unit == "1" else f" {o.unit}"
            lines += wrapped(f"{o.verdict} {name}, margin {downward(o.margin)}{unit}: {o.statement}")
            lines += wrapped(f"would pass: {o.remedy}", "    ") if o.remedy else []
    return lines


def wrapped(text: str, indent: str = "") -> list[str]:
    """Lines of at most 78 columns."""
    return textwrap.wrap(text, 76, initial_indent=indent, subsequent_indent=indent + "  ")


if __name__ == "__main__":
    sys.exit(main())
