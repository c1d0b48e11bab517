"""The table as values: rows with a cell for each contender, and targets with their results."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

ENGINE, FLOOR = "this engine", "floor"


@dataclass(frozen=True, slots=True)
class Cell:
    """One figure in the row's unit, and its ratio to the figure of `against` (the floor if empty)."""

    value: float
    times: float | None = None
    against: str = ""

    def __str__(self) -> str:
        against = f" {self.against}" if self.against else ""
        return number(self.value) + ("" if self.times is None else f" ({number(self.times)}x{against})")


@dataclass(frozen=True, slots=True)
class Target:
    """The bound of a figure: its maximum, or with `least` its minimum. Without a value it could not be measured."""

    what: str
    bound: float
    value: float | None
    least: bool = False

    @property
    def met(self) -> bool | None:
        """Whether the figure meets the bound; `None` if it was not measured."""
        if self.value is None:
            return None
        return self.value >= self.bound if self.least else self.value <= self.bound

    def __str__(self) -> str:
        verdict = {True: "met", False: "missed", None: "not measured"}[self.met]
        found = "" if self.value is None else f" ({number(self.value)})"
        return f"{'≥' if self.least else '≤'} {self.bound:g}{self.what}: {verdict}{found}"


@dataclass(frozen=True, slots=True)
class Row:
    """A case: the contenders' figures, the engine's lead over the fastest peer, and the targets."""

    case: str
    unit: str
    cells: dict[str, Cell]
    lead: float | None = None
    fastest: str = ""
    targets: list[Target] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "case": self.case, "unit": self.unit, "lead": self.lead, "fastest_peer": self.fastest,
            "cells": {
                name: {"value": one.value, "times": one.times, "against": one.times and (one.against or FLOOR)}
                for name, one in self.cells.items()
            },
            "targets": [
                {"target": str(one), "bound": one.bound, "value": one.value, "met": one.met} for one in self.targets
            ],
        }  # fmt: skip


def table(rows: list[Row], columns: list[str]) -> str:
    """Return a Markdown table with aligned columns."""
    led = any(row.lead is not None for row in rows)
    head = ["case", *columns, *(["lead"] if led else []), "target"]
    lines = [
        [f"{row.case}, {row.unit}", *_cells(row, columns), *([_lead(row)] if led else []), _targets(row)]
        for row in rows
    ]
    widths = [max(len(line[n]) for line in (head, *lines)) for n in range(len(head))]
    rule = ["-" * width for width in widths]
    text = ["| " + " | ".join(map(str.ljust, line, widths)) + " |" for line in (head, rule, *lines)]
    return "\n".join(text)


def _cells(row: Row, columns: list[str]) -> list[str]:
    return [str(row.cells.get(name, "")) for name in columns]


def _lead(row: Row) -> str:
    return "" if row.lead is None else f"{number(row.lead)}x {row.fastest}"


def _targets(row: Row) -> str:
    return "; ".join(map(str, row.targets))


def number(value: float) -> str:
    """Return three digits, more than the rounds agree on."""
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}"
