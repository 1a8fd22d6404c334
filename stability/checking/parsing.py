"""Numbers, hashes and operation lists of a file, refused where they are malformed.

Must fail: numbers in other forms, doubled keys, changed content, unknown operators, indices that come later.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from fractions import Fraction
from typing import Any

from .limits import MAX_BYTES, MAX_DIGITS, MAX_EXPONENT, MAX_OPERATIONS, NUMBER, SCHEMA, UnreadableError, need


def wrong_schema(found: Any) -> str:
    """What to say to a file of another kind or version."""
    if found is None:
        return f'it names no schema, and a gain file names "{SCHEMA}"; write one with design'
    known = {"hdmm-opt/gains/1": "hdmm-opt 0.1 reads it", "hdmm-opt/rejected/2": "a refused design left it, not proved"}
    old = known.get(found if isinstance(found, str) else "", "use the release that wrote the file")
    return f'this release reads "{SCHEMA}": got {str(found)[:60]!r}; {old}'


def number(value: Any, what: str) -> Fraction:
    """A number of the file as an exact rational."""
    need(
        not isinstance(value, bool) and isinstance(value, int | Fraction | str),
        f"{what} must be a number: got {value!r:.60}",
    )
    if isinstance(value, str):
        return rational(value, what)
    return Fraction(value)


def rational(text: str, what: str = "a number") -> Fraction:
    """Parse decimal or p/q text with bounded length and exponent."""
    need(len(text) <= MAX_DIGITS, f"{what} has over {MAX_DIGITS} digits")
    need(NUMBER.fullmatch(text) is not None, f"{what} must be a finite number: got {text[:40]!r}")
    exponent = text.lower().partition("e")[2] or "0"
    need(abs(int(exponent)) <= MAX_EXPONENT, f"{what} has an exponent beyond {MAX_EXPONENT}: {text[:40]}")
    need(not text.endswith("/0"), f"{what} divides by zero")
    value = Fraction(text)
    return value


def numbers(value: Any, count: int, what: str) -> list[Fraction]:
    """A list of numbers of a given length."""
    need(isinstance(value, list) and len(value) == count, f"{what} must list {count} numbers")
    return [number(entry, what) for entry in value]


def parse(text: str) -> dict[str, Any]:
    """JSON with exact decimals, no NaN, no doubled keys."""
    need(len(text) <= MAX_BYTES, f"a gain file has at most {MAX_BYTES} bytes")

    def pairs(items: list[tuple[str, Any]]) -> dict[str, Any]:
        need(len({key for key, _ in items}) == len(items), "an object has the same key twice")
        return dict(items)

    def constant(name: str) -> Any:
        raise UnreadableError(f"{name} is not a number that a gain file may hold")

    try:
        data = json.loads(
            text, parse_float=rational, parse_int=rational, parse_constant=constant, object_pairs_hook=pairs
        )
    except json.JSONDecodeError as error:
        what = "it looks like a study: run design on it" if text.lstrip()[:1] in ("[", "#") else "write it with design"
        raise UnreadableError(f"not a complete JSON file: {error.msg} at line {error.lineno}; {what}") from None
    except RecursionError:
        raise UnreadableError("the JSON is nested too deeply") from None
    need(isinstance(data, dict), "a gain file is a JSON object")
    return data


def digest(text_or_data: Any, *leave_out: str) -> str:
    """SHA-256 of canonical JSON (sorted keys, no spaces, floats as Python prints them), without some top-level keys."""
    data = json.loads(text_or_data) if isinstance(text_or_data, str) else text_or_data
    kept = {key: value for key, value in data.items() if key not in leave_out}
    canonical = json.dumps(kept, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()


def check_digests(text: str) -> None:
    """Refuse a file whose content does not match the hashes it carries."""
    plain = json.loads(text)
    parts = [("study", plain.get("study"))]
    members = plain.get("members")
    need(isinstance(members, list) and all(isinstance(m, dict) for m in members), "the members are missing")
    parts += [(f"the reference of {m.get('name')!r:.40}", m.get("reference")) for m in members]
    for part, section in parts:
        need(isinstance(section, dict), f"{part} is missing; write the file again with design")
        same = section.get("sha256") == digest(section, "sha256")
        need(same, f"{part} was changed after the file was written (sha256 differs)")
    whole = plain.get("sha256") == digest(plain, "sha256", "provenance")
    need(whole, "the file was changed after it was written (sha256 differs)")


def valid_program(program: Any, what: str, *, turning: bool = False) -> dict[str, Any]:
    """Structure of an operation list: known operators, sines and cosines or maxima, arguments that come earlier."""
    need(isinstance(program, dict) and isinstance(program.get("operations"), list), f"{what} must be an operation list")
    operations, arity = (
        program["operations"],
        {"neg": 1, "sq": 1, "sqrt": 1, "tanh": 1, "add": 2, "sub": 2, "mul": 2, "div": 2},
    )
    arity |= {"sin": 1, "cos": 1} if turning else {"max": 2}
    need(0 < len(operations) <= MAX_OPERATIONS, f"{what} must have 1 to {MAX_OPERATIONS} operations")
    clean: list[list[Any]] = []
    for k, entry in enumerate(operations):
        need(
            isinstance(entry, list) and len(entry) >= 2 and isinstance(entry[0], str),
            f"{what}: operation {k} is malformed",
        )
        operator, *arguments = entry
        if operator in ("input", "const"):
            need(
                len(arguments) == 1 and isinstance(arguments[0], str), f"{what}: operation {k} needs one name or number"
            )
            if operator == "const":
                rational(arguments[0], what)
        else:
            need(operator in arity and len(arguments) == arity[operator], f"{what}: unknown operation {operator!r:.30}")
            arguments = [index(a, k, what) for a in arguments]
        clean.append([operator, *arguments])
    outputs = [index(o, len(clean), what) for o in program.get("outputs", [])]
    need(bool(outputs), f"{what} has no output")
    names = list(dict.fromkeys(arguments[0] for operator, *arguments in clean if operator == "input"))
    need(sorted(program["inputs"]) == sorted(names), f"{what} does not list the inputs that it has")
    return {"operations": clean, "outputs": outputs}


def index(value: Any, end: int, what: str) -> int:
    """A whole number in [0, end)."""
    need(
        isinstance(value, Fraction) and value.denominator == 1 and 0 <= value < end, f"{what}: an index is out of range"
    )
    return int(value)


def reads(program: dict[str, Any], outputs: Iterable[int] | None = None) -> set[str]:
    """Names of the inputs that some outputs depend on."""
    needed, names = set(program["outputs"] if outputs is None else outputs), set()
    for k in range(len(program["operations"]) - 1, -1, -1):
        if k in needed:
            operator, *arguments = program["operations"][k]
            if operator == "input":
                names.add(arguments[0])
            elif operator != "const":
                needed.update(arguments)
    return names


def only(program: dict[str, Any], outputs: list[int]) -> dict[str, Any]:
    """The program of some entries alone."""
    needed = set(outputs)
    for k in range(len(program["operations"]) - 1, -1, -1):
        operator, *arguments = program["operations"][k]
        if k in needed and operator not in ("input", "const"):
            needed.update(arguments)
    place = {old: new for new, old in enumerate(sorted(needed))}
    made = []
    for old in sorted(needed):
        operator, *arguments = program["operations"][old]
        made.append([operator, *(arguments if operator in ("input", "const") else (place[k] for k in arguments))])
    return {"operations": made, "outputs": [place[k] for k in outputs]}
