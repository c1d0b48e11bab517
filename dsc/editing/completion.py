"""Completion: the keys, names and values that are valid at a cursor, also in half-written texts."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from dsc.editing.cursor import Cursor, cursor_at
from dsc.editing.keys import Schema, keys_at, plot_form, profile_form, values_at
from dsc.editing.kinds import Kind
from dsc.editing.names import NameKind
from dsc.editing.plot_data import used_plots
from dsc.editing.roles import PLOT, role_of
from dsc.editing.view import View
from dsc.events import EXECUTIVES
from dsc.text.profiles import BY_PLOT
from knowledge_base.language.syntax.expression import KEYWORDS

_WORD = re.compile(r"[\w?.\-]*$")


@dataclass(frozen=True, slots=True)
class Proposal:
    """A text that completes the word before the cursor.

    Attributes:
        label: the text.
        kind: `key`, `value`, or the kind of a name.
        about: a line about it.
    """

    label: str
    kind: str
    about: str = ""


def complete(view: View, offset: int) -> list[Proposal]:
    """Return the proposals at an offset of a page's text, sorted by label."""
    text, kind = view.page.text, view.page.kind
    if kind is Kind.PDDL:
        found = _in_pddl(view, text[:offset])
    elif kind is Kind.PLOT:
        found = _in_plot(view, cursor_at(text, offset))
    elif kind is Kind.PROFILE:
        found = _in_profile(view, cursor_at(text, offset))
    elif kind is Kind.SCENARIO and view.facts.scenario is not None:
        found = _by_schema(view.facts.scenario, cursor_at(text, offset))
    else:
        found = []
    return sorted({one.label: one for one in found}.values(), key=lambda one: one.label)


def word_before(text: str, offset: int) -> str:
    """Return the part of a word before an offset, which a proposal replaces."""
    found = _WORD.search(text, text.rfind("\n", 0, offset) + 1, offset)
    return "" if found is None else found[0]


def _by_schema(form: Schema, cursor: Cursor) -> list[Proposal]:
    if cursor.value is None:
        return [Proposal(key, "key", about) for key, about in keys_at(form, cursor.path).items()]
    return [Proposal(value, "value") for value in values_at(form, cursor.path)]


def _in_plot(view: View, cursor: Cursor) -> list[Proposal]:
    if cursor.in_expression:
        return _in_expression(view, cursor.prefix)
    role = role_of(PLOT, cursor.path)
    if cursor.value is None:
        names = _key_names(view, cursor, role)
        return names if names is not None else _by_schema(plot_form(), cursor)
    if role == "skill":
        return _skills(view)
    kind = _KINDS.get(role)
    scope = view.page.plot if kind == "state" else None
    found = [] if kind is None else _names(view, kind, scope)
    return found + _by_schema(plot_form(), cursor)


_KINDS: dict[str, NameKind] = {
    "target": "state", "ways": "state", "way": "state", "cases": "state", "plot": "plot", "plots": "plot",
    "action": "action", "event": "event", "type": "type", "declaration": "type",
}  # fmt: skip


def _key_names(view: View, cursor: Cursor, role: str) -> list[Proposal] | None:
    """Return the names that are keys: events under `on`, arguments under `with`; `None` for a mapping with keys."""
    if role in {"on", "events"}:
        return [*_outcomes(view, cursor), *_names(view, "event")]
    content = _state(view, cursor.path[:-1])
    if role == "arguments":
        return [one for plot in used_plots(content) for one in _names(view, "variable", plot)]
    if cursor.path[-1:] == ("with",) and role_of(PLOT, cursor.path[:-1]) == "actions":
        skill = view.facts.skill(str(content.get("trigger", "")))
        return (
            [] if skill is None else [Proposal(name, "variable", str(kind)) for name, kind in skill.parameters.items()]
        )
    return None


def _outcomes(view: View, cursor: Cursor) -> list[Proposal]:
    """Return the outcomes of the skills and plots of the state around, and `done`."""
    state = _state(view, cursor.path[:-1])
    entry = state.get("entry") or []
    actions = entry if isinstance(entry, list) else [entry]
    skills = [view.facts.skill(str(one.get("trigger"))) for one in actions if isinstance(one, dict)]
    found = [Proposal(event, "event", "outcome of the skill") for one in skills if one for event in one.outcomes]
    used = used_plots(state)
    for page in view.pages:
        if page.plot and page.plot in used:
            found += [
                Proposal(str(event), "event", f"outcome of {page.plot}") for event in page.data.get("emits") or {}
            ]
    return [*found, *(Proposal(event, "event", "of the executive") for event in sorted(EXECUTIVES))]


def _state(view: View, path: tuple[str | int, ...]) -> dict[str, Any]:
    """Return the mapping at a path of the last content without a mistake; empty if it has none."""
    data = view.page.data
    for key in path:
        try:
            data = data[key]
        except (KeyError, IndexError, TypeError):
            if key != 0:  # a list of one may be written without brackets
                return {}
    return data if isinstance(data, dict) else {}


def _skills(view: View) -> list[Proposal]:
    found = []
    for one in view.facts.skills or ():
        given = ", ".join(f"{name}: {kind or 'any'}" for name, kind in one.parameters.items())
        found.append(Proposal(f"{one.component}.{one.name}", "skill", f"({given}) -> {', '.join(one.outcomes)}"))
    return found


def _in_expression(view: View, prefix: str) -> list[Proposal]:
    if prefix.startswith("?"):
        own = view.definitions("variable", view.page.plot)
        return [Proposal(f"?{name}", "variable", about) for name, about in own.items()]
    found = [*_names(view, "relation"), *_names(view, "type"), *_names(view, "object")]
    schema, objects = view.facts.schema, view.facts.objects
    if schema is not None:
        found += [Proposal(name, "relation", str(one)) for name, one in schema.predicates.items()]
        found += [Proposal(name, "type") for name in schema.types]
    found += [Proposal(name, "object", kind) for name, kind in (objects or {}).items()]
    own = view.definitions("variable", view.page.plot)
    return found + [Proposal(f"?{name}", "variable", about) for name, about in own.items()]


def _in_pddl(view: View, before: str) -> list[Proposal]:
    prefix = word_before(before, len(before))
    head = before[: len(before) - len(prefix)].rstrip()
    if prefix.startswith("?"):
        action = re.findall(r"\(:(?:durative-)?action\s+(\S+)", before)
        own = view.definitions("variable", f"action {action[-1]}") if action else {}
        return [Proposal(f"?{name}", "variable") for name in own]
    if head.endswith("-"):
        return [*_names(view, "type"), Proposal("object", "type")]
    if head.endswith("("):
        return [*_names(view, "relation"), *(Proposal(word, "key") for word in sorted(KEYWORDS) if word.isalpha())]
    return [*_names(view, "object"), *_names(view, "type")]


def _in_profile(view: View, cursor: Cursor) -> list[Proposal]:
    path = cursor.path
    if cursor.value is None and path:
        group, *rest = path
        if group in BY_PLOT:
            kind: NameKind = "plot" if not rest else "state" if group == "choose" else "variable"
            return _names(view, kind, str(rest[0]) if rest else None)
        if group == "components":
            known = view.facts.components
            if not rest:
                return [Proposal(name, "key") for name in known]
            named = known.get(str(rest[0]))
            return (
                [] if named is None else [Proposal(name, "variable", about) for name, about in named.parameters.items()]
            )
    return _by_schema(profile_form(), cursor)


def _names(view: View, kind: NameKind, scope: str | None = None) -> list[Proposal]:
    return [Proposal(name, kind, about) for name, about in view.definitions(kind, scope).items()]
