"""Goals in texts: of the dynamic states of a plot, and of PDDL problems."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from dsc.editing.kinds import Kind
from dsc.editing.plot_data import part_at
from dsc.editing.roles import PLOT, role_of
from dsc.editing.workspace import Page
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.expression import variables_in_order
from knowledge_base.language.syntax.text import parse_condition

_OF_PROBLEM = re.compile(r"(?P<skip>;[^\n]*)|(?P<goal>\(\s*:goal\b)|(?P<bracket>[()])", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Goal:
    """A goal in a text.

    Attributes:
        begin, end: the span of key and condition, in characters.
        condition: the goal of a plot's state; empty for the goal of a PDDL problem.
    """

    begin: int
    end: int
    condition: str = ""


def goals_of(page: Page) -> list[Goal]:
    """Return the goals in a text; none in half-written YAML."""
    if page.kind is Kind.PDDL:
        return [*_problem_goals(page.text)]
    return [*_state_goals(page)] if page.kind is Kind.PLOT and page.fresh else []


def goal_at(page: Page, offset: int) -> Goal | None:
    """Return the goal around an offset."""
    return next((one for one in goals_of(page) if one.begin <= offset <= one.end), None)


def unknown_values(condition: str) -> str:
    """Return the reason why a goal cannot be planned before a run: the variables that have no value; empty if none."""
    try:
        names = dict.fromkeys(variables_in_order(parse_condition(condition)))
    except InputError:  # the planning process names the mistake
        return ""
    values = ", ".join(f"?{name}" for name in names)
    return f"the goal needs a value of {values}, which only a run gives" if values else ""


def _state_goals(page: Page) -> Iterator[Goal]:
    for path, (begin, _) in page.spans.keys.items():
        condition = part_at(page.data, path)
        if path[-1] == "goal" and role_of(PLOT, path[:-1]) == "state" and isinstance(condition, str):
            yield Goal(begin, page.spans.values[path][1], condition)


def _problem_goals(text: str) -> Iterator[Goal]:
    begin, depth = -1, 0
    for match in _OF_PROBLEM.finditer(text):
        if match["goal"]:
            begin, depth = match.start(), 1
        elif begin >= 0 and match["bracket"]:
            depth += 1 if match["bracket"] == "(" else -1
            if depth == 0:
                yield Goal(begin, match.end())
                begin = -1
