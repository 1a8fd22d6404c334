"""The command: files in, verdicts out."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from .arithmetic import WORK
from .coupling import Coupling, guarantees_kept
from .limits import (
    COUPLED,
    MAX_BYTES,
    MAX_COUPLED,
    MAX_MEMBERS,
    NAME,
    OBSERVED,
    SCHEMA,
    NotProvedError,
    UnreadableError,
    need,
)
from .member import Member, check_member, missing
from .obligation import Obligation, Report
from .obligations import milli
from .observer import observed
from .parsing import check_digests, number, parse, wrong_schema


def check_text(text: str, file: str = "") -> Report:
    """Re-prove a gain file given as text.

    Returns:
        Status 0 proved, 1 not proved, 2 unreadable; with one line and the obligations.
    """
    try:
        data = parse(text)
        need(data.get("schema") == SCHEMA, wrong_schema(data.get("schema")))
        check_digests(text)
        return check_machine(data, file)
    except UnreadableError as error:
        return Report(file, 2, f"unreadable: {error}")
    except NotProvedError as error:
        return Report(file, 1, f"not proved: {error}")
    except (KeyError, TypeError, AttributeError, IndexError, ValueError, ZeroDivisionError, OverflowError) as error:
        return Report(file, 2, f"unreadable: a part of the gain file is missing or malformed: {error!r:.120}")


def check_machine(data: dict[str, Any], file: str) -> Report:
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
        ("uncertainty.initial", study["uncertainty"].get("initial", {}), states),
    ):
        need(set(given) <= known, f"the study's {where} names something that the file does not have")
    need(not study["plant"].get("parameters"), "a parameter of the study stands with the member that has it")
    couplings = data["couplings"]
    need(isinstance(couplings, list) and len(couplings) <= 1, "a machine has one coupling, or none")
    need(all(entry["members"] == names for entry in couplings), "a coupling is of all members in their order")
    need(len(names) == 1 or bool(couplings), "members without a coupling are files of their own")
    made: list[Obligation] = []
    members = []
    for entry in data["members"]:
        member = check_member(data, entry, bool(couplings))
        made += member.made
        if member.failed:
            where = f"{member.name}: " if len(names) > 1 else ""
            return Report(file, 1, f"not proved: {where}{member.failed}", made)
        members.append(member)
    return check_together(data, members, made, file)


def check_together(data: dict[str, Any], members: list[Member], made: list[Obligation], file: str) -> Report:
    """What joins the members: guarantees, coupling, observers; and the bound on the output."""
    WORK.begin(MAX_COUPLED)
    observing = data["study"]["controller"].get("observer") is not None
    required = [*(COUPLED if data["couplings"] else ()), *(OBSERVED if observing else ())]
    if required:
        made.append(guarantees_kept(data, members))
    coupling = Coupling(data, data["couplings"][0], members) if data["couplings"] else None
    made += coupling.obligations() if coupling is not None else []
    made += [observed(data, members)] if observing else []
    failed = missing(data, dict.fromkeys(required), "")
    wrong = [o for o in made if o.verdict != "proved"]
    if failed or wrong:
        return Report(
            file, 1, f"not proved: {failed or f'{wrong[0].name} (margin {wrong[0].margin:.4g} {wrong[0].unit})'}", made
        )
    settled = float(members[0].claim.transient)
    if coupling is None:
        claim = members[0].claim
        bound = milli(claim.ultimate[0], str(claim.rows[0]["unit"]))
        return Report(file, 0, f"proved: |tracking error| <= {bound} from {settled:g} s on", made)
    seen = number(data["validation"]["largest_error_m"], "largest_error_m")
    need(seen >= 0, "largest_error_m must not be negative")
    if seen > coupling.output([member.claim.half_widths[0] for member in members]):
        return Report(file, 1, "not proved: the recorded simulation leaves the certified envelope", made)
    bound = milli(coupling.stated, "m")
    message = (
        f"proved: |tracking error of the output| <= {bound} from {settled:g} s on, all {len(members)} members together"
    )
    return Report(file, 0, message, made)


def check_file(path: Path) -> Report:
    """Re-prove one file."""
    try:
        if path.stat().st_size > MAX_BYTES:
            return Report(str(path), 2, f"unreadable: a gain file has at most {MAX_BYTES} bytes")
        return check_text(path.read_text(encoding="utf-8"), str(path))
    except (OSError, UnicodeDecodeError) as error:
        return Report(str(path), 2, f"unreadable: {error}")


def main(arguments: list[str] | None = None) -> int:
    """Check files; print one verdict a file and one line an obligation."""
    parser = argparse.ArgumentParser(description="Re-prove gain files from the files alone.")
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--json", action="store_true", help="print the verdicts as JSON")
    options = parser.parse_args(arguments)
    reports = [check_file(path) for path in options.files]
    show(reports, as_json=options.json)
    return max(report.status for report in reports)


def several(report: Report) -> bool:
    """Whether a report is of more than one member."""
    return len({o.member for o in report.obligations if o.member}) > 1


def show(reports: list[Report], *, as_json: bool) -> None:
    """Print the verdicts."""
    if as_json:
        rows = [{**r.__dict__, "obligations": [o.__dict__ for o in r.obligations]} for r in reports]
        print(json.dumps(rows, indent=1))
    else:
        for report in reports:
            print(f"{report.file}: {report.message}")
            for o in report.obligations:
                name = f"{o.member}: {o.name}" if several(report) and o.member else o.name
                print(f"  {o.verdict:9} {name:12} margin {o.margin:.4g} {o.unit}: {o.statement}")
                if o.remedy:
                    print(f"            would pass: {o.remedy}")


if __name__ == "__main__":
    sys.exit(main())
