"""The table as values: rows with a cell for each contender, and targets with what became of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

ENGINE, FLOOR = "this engine", "floor"


@dataclass(frozen=True, slots=True)
class Cell:
    """One figure in the row's unit, and how many times as much it is as that of `against` (the floor if empty)."""

    value: float
    times: float | None = None
    against: str = ""

    def __str__(self) -> str:
        against = f" {self.against}" if self.against else ""
        return number(self.value) + ("" if self.times is None else f" ({number(self.times)}x{against})")


@dataclass(frozen=True, slots=True)
class Target:
    """What a figure shall be: at most (or at least) the bound. No value: it could not be measured."""

    what: str
    bound: float
    value: float | None
    least: bool = False

    @property
    def met(self) -> bool | None:
        """Whether it is; `None` if nobody knows."""
        if self.value is None:
            return None
        return self.value >= self.bound if self.least else self.value <= self.bound

    def __str__(self) -> str:
        verdict = {True: "met", False: "missed", None: "not measured"}[self.met]
        found = "" if self.value is None else f" ({number(self.value)})"
        return f"{'≥' if self.least else '≤'} {self.bound:g}{self.what}: {verdict}{found}"


@dataclass(frozen=True, slots=True)
class Row:
    """A case: who takes how long, how much faster than the fastest peer the engine is, and what was hoped for."""

    case: str
    unit: str
    cells: dict[str, Cell]
    lead: float | None = None
    fastest: str = ""
    targets: list[Target] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
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
    """A Markdown table that can be read as it stands."""
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
    """Three digits, which is more than the rounds agree on."""
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}"
