"""What the functions return: records that show themselves as tables and plots in a notebook."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

from stability import checker

from ..errors import InvalidInputError
from ..files.read import certified_of, read, rejected
from ..files.restore import restored, whole
from ..files.seal import to_text
from ..files.text import prepared_folder, upward, write_text
from .threads import alone

#: Plain styles of a table, so that it reads the same in a light and in a dark notebook.
_CELL = "padding:.2em .8em;text-align:left"


def html_table(heads: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A table in HTML; numbers in five digits."""
    head = "".join(f'<th style="{_CELL}">{escape(name)}</th>' for name in heads)
    body = "".join(
        "<tr>" + "".join(f'<td style="{_CELL}">{escape(_shown(v))}</td>' for v in row) + "</tr>" for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _shown(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.5g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True, kw_only=True)
class Designed:
    """A design: proved, or refused with what failed.

    Attributes:
        document: The gain file, or what a refusal leaves, as data.
        message: The verdict in one line.
        failures: Obligation, margin with unit, and what would do, of everything that failed.
        notes: What is told beside a proof.
    """

    document: Mapping[str, Any] = field(repr=False)
    message: str
    failures: tuple[tuple[str, str, str], ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def proved(self) -> bool:
        """Whether the checker has proved it and every requirement is met."""
        return not rejected(self.document)

    @property
    def name(self) -> str:
        """Name of the study."""
        return self.document["study"]["study"]["name"]

    @property
    def gains(self) -> dict[str, float]:
        """Gains by name, with the member before it where there are some."""
        several = len(self.document["members"]) > 1
        return {
            f"{entry['name']}.{gain['name']}" if several else gain["name"]: gain["value"]
            for entry in self.document["members"] for gain in entry["gains"]
        }  # fmt: skip

    @property
    def certified_m(self) -> float | None:
        """Certified bound on the error of the output after the transient, m; None where nothing is proved."""
        return certified_of(self.document) if self.proved else None

    @property
    def requirements(self) -> list[dict[str, Any]]:
        """Each requirement: required, simulated, and certified where it is proved; empty for a refused design."""
        return list(self.document["validation"]["requirements"]) if self.proved else []

    def save(self, path: str | Path | None = None) -> Path:
        """Write the gain file, or what a refusal leaves: whole or not at all.

        Args:
            path: Where; NAME.gains.json or NAME.rejected.json where None.

        Raises:
            InvalidInputError: the place cannot be written, or a refused design is to be written as a gain file.
        """
        usual = f"{self.name}.gains.json" if self.proved else f"{self.name}.rejected.json"
        target = Path(usual if path is None else path)
        if not self.proved and target.name.endswith(".gains.json"):
            raise InvalidInputError(f"{target}: a design that is not proved is not a gain file; name it .rejected.json")
        write_text(target, to_text(dict(self.document)))
        return target

    def report(self, folder: str | Path = "report") -> Path:
        """Write the HTML page.

        Raises:
            InvalidInputError: the report libraries are not installed, or the folder cannot be written.
        """
        return alone(page_of)(self.document, Path(folder))

    def plot(self) -> Any:
        """The simulated scenarios with their bounds, as a Plotly figure.

        Raises:
            InvalidInputError: Plotly is not installed.
        """
        from ..files.report import check_report

        check_report()
        from ..files.pictures import figure

        return alone(lambda: figure(self.document, *restored(self.document)))()

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.message}"]
        lines += [f"  {name} ({margin}): {remedy}" for name, margin, remedy in self.failures]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        text = f"<p><b>{escape(self.name)}</b>: {escape(self.message)}</p>"
        if not self.proved:
            return text + html_table(("what failed", "margin", "what would do"), self.failures)
        rows = [(r["name"], r["required"], r["certified"], r["simulated"]) for r in self.requirements]
        text += html_table(("requirement", "required", "certified", "simulated"), rows)
        return text + html_table(("gain", "value"), list(self.gains.items()))


@dataclass(frozen=True, kw_only=True)
class Checked:
    """The checker's verdict on a gain file.

    Attributes:
        verdict: Status, message, obligations, and the certified share of every limit.
    """

    verdict: checker.Report

    @property
    def proved(self) -> bool:
        """Whether everything is proved."""
        return self.verdict.status == 0

    @property
    def obligations(self) -> list[checker.Obligation]:
        """Every obligation that was decided."""
        return self.verdict.obligations

    @property
    def limits(self) -> dict[str, float]:
        """The share of every limit that is certified to be used at most."""
        several = len({use.member for use in self.verdict.uses}) > 1
        return {f"{u.member} {u.name}" if several else u.name: u.share for u in self.verdict.uses}

    def __str__(self) -> str:
        return self.verdict.message

    def _repr_html_(self) -> str:
        rows = [(f"{o.member} {o.name}".strip(), o.verdict, o.margin, o.unit, o.statement) for o in self.obligations]
        heads = ("obligation", "verdict", "margin", "unit", "statement")
        return f"<p>{escape(self.verdict.message)}</p>" + html_table(heads, rows)


@dataclass(frozen=True, kw_only=True)
class Simulated:
    """Runs of a closed loop; they agree or disagree with a proof, and prove nothing.

    Attributes:
        figures: What each run did, by scenario.
        missed: Requirements that a run inside the assumptions missed, as text.
        traces: Signals of each run, by scenario.
        bound_m: Certified bound on the error of the output, m; None where nothing is proved.
        unit: Unit of the output.
    """

    figures: Mapping[str, Any]
    missed: tuple[str, ...]
    traces: Mapping[str, Any] = field(repr=False)
    bound_m: float | None
    unit: str

    def plot(self) -> Any:
        """Error of the output in every run with its certified bound, as a Plotly figure.

        Raises:
            InvalidInputError: Plotly is not installed.
        """
        from ..files.report import check_report

        check_report()
        from plotly.graph_objects import Figure

        shown = Figure()
        for name, trace in self.traces.items():
            shown.add_scatter(x=trace.t, y=1e3 * trace.error, name=name, mode="lines")
        if self.bound_m is not None:
            text = f"certified {upward(1e3 * self.bound_m)} m{self.unit}"
            shown.add_hline(y=1e3 * self.bound_m, line_dash="dash", annotation_text=text)
        shown.update_layout(xaxis_title="time [s]", yaxis_title=f"error of the output [m{self.unit}]")
        return shown

    def _repr_html_(self) -> str:
        heads = ("scenario", f"largest error [m{self.unit}]", f"RMS [m{self.unit}]", "share of the limits")
        rows = [(name, 1e3 * f.maximum_error_m, 1e3 * f.rms_error_m, f.limit_use) for name, f in self.figures.items()]
        return html_table(heads, rows) + "".join(f"<p>requirement missed: {escape(line)}</p>" for line in self.missed)


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows of a comparison, a sweep, a trade-off or an attack.

    Attributes:
        title: What the rows are.
        heads: Names of the columns.
        rows: Values.
        axes: Names of the two columns that a plot shows against each other.
        data: The whole result, as data.
    """

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    axes: tuple[str, str]
    data: Any = field(repr=False, default=None)

    def column(self, name: str) -> list[Any]:
        """A column by its name.

        Raises:
            ValueError: there is none.
        """
        at = self.heads.index(name)
        return [row[at] for row in self.rows]

    def plot(self) -> Any:
        """One column against another, as a Plotly figure.

        Raises:
            InvalidInputError: Plotly is not installed.
        """
        from ..files.report import check_report

        check_report()
        from plotly.graph_objects import Figure

        x, y = self.axes
        shown = Figure()
        shown.add_scatter(x=self.column(x), y=self.column(y), mode="markers", text=[str(row[0]) for row in self.rows])
        shown.update_layout(title=self.title, xaxis_title=x, yaxis_title=y)
        return shown

    def _repr_html_(self) -> str:
        return f"<p>{escape(self.title)}</p>" + html_table(self.heads, self.rows)


def document_of(given: Designed | str | Path) -> dict[str, Any]:
    """The data of a design or of a file.

    Raises:
        InvalidInputError: the file cannot be read.
    """
    return dict(given.document) if isinstance(given, Designed) else read(Path(given))


def page_of(document: Mapping[str, Any], folder: Path) -> Path:
    """Write the HTML page of a file's data.

    Raises:
        InvalidInputError: the report libraries are not installed, or the folder cannot be written.
    """
    from ..files.report import PAGE_NAME, check_report, write_report

    check_report()
    prepared_folder(folder, PAGE_NAME)
    with whole():
        return write_report(document, folder)
