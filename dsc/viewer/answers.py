"""What the page asks beyond records: the knowledge of a moment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dsc.viewer.moments import knowledge
from dsc.viewer.records import RecordLog
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Fact
from knowledge_base.language.expression import variables_in_order
from knowledge_base.language.parser import parse_condition
from knowledge_base.view import View

Form = Mapping[str, Any]


class Answers:
    """Answers to one page's questions, each a JSON value; a question that makes no sense is an `InputError`."""

    def __init__(self, log: RecordLog) -> None:
        self._log = log
        self._knowledge = knowledge(log)

    def query(self, asked: Form) -> dict[str, Any]:
        """Who makes the expression true, or whether it is true and why."""
        view = self._view(asked)
        params = asked.get("params") or {}
        condition = parse_condition(_text(asked, "expression"), "EXPR")
        variables = [name for name in dict.fromkeys(variables_in_order(condition)) if name not in params]
        answers = view.query(condition, params)
        said = {"variables": variables, "holds": bool(answers), "answers": answers, "version": view.version}
        return said if variables else {**said, "why": view.explain(condition, params).to_json()}

    def facts(self, asked: Form) -> dict[str, Any]:
        """All that is known, or all that is known about one thing."""
        view, about = self._view(asked), asked.get("about")
        things, facts, values = view.nodes(), view.facts(), view.values()
        if about is not None:
            if about not in things:
                raise UnknownNameError(f"there is no object '{about}'", found=str(about), valid=things)
            facts = [fact for fact in facts if about in fact.args]
            values = {fluent: value for fluent, value in values.items() if about in fluent.args}
            near = {arg for fact in (*facts, *values) for arg in fact.args} | {about}
            things = {name: kind for name, kind in things.items() if name in near}
        return {
            "version": view.version,
            "things": things,
            "facts": [_listed(fact) for fact in facts],
            "values": [[*_listed(fluent), value] for fluent, value in values.items()],
        }

    def _view(self, asked: Form) -> View:
        known = self._knowledge.at(_seq(asked))
        return View(known.state, known.version)


def _listed(fact: Fact) -> list[Any]:
    return [fact.predicate, *fact.args]


def _seq(asked: Form) -> int:
    seq = asked.get("seq")
    if isinstance(seq, bool) or not isinstance(seq, int):
        raise InputError("'seq' is the number of a record")
    return seq


def _text(asked: Form, name: str) -> str:
    said = asked.get(name)
    if not isinstance(said, str):
        raise InputError(f"'{name}' is a text")
    return said
