"""Commands that query a present or past world, list a store's past changes, and follow new ones."""

from __future__ import annotations

import time
from dataclasses import asdict
from itertools import chain, islice
from typing import TYPE_CHECKING, Annotated, Any

import typer

from knowledge_base.cli.console import (
    Domain,
    Json,
    Source,
    Store,
    change_form,
    clock_time,
    delta_lines,
    moment,
    opened,
    opened_store,
    print_json,
    print_json_list,
    print_line,
    print_table,
)
from knowledge_base.errors import InputError, UnknownNameError, printable
from knowledge_base.spelling import value_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from knowledge_base.facts import Change, Value
    from knowledge_base.language.syntax.expression import Expression
    from knowledge_base.pddl import ProblemText
    from knowledge_base.store import KnowledgeBase
    from knowledge_base.view import View

Expr = Annotated[str, typer.Argument(metavar="EXPR", help="A condition; the answers bind its variables, such as ?x.")]
Question = Annotated[str, typer.Argument(metavar="EXPR", help="A condition without open variables.")]
Params = Annotated[
    list[str] | None, typer.Option("--param", "-p", metavar="x=VALUE", help="A value for ?x; may be repeated.")
]
Explain = Annotated[bool, typer.Option("--explain", help="Show the query plan.")]
Why = Annotated[bool, typer.Option("--why", help="Show each part with its truth, and the deciding one.")]
Limit = Annotated[int | None, typer.Option("--limit", min=1, help="Stop after this number of answers.")]
Seconds = Annotated[
    float | None, typer.Option("--seconds", min=0.0, help="Stop the query after this number of seconds.")
]
NO = 1
"""Exit status of the answer `no`; status 2 is an error, as for every command."""
Pattern = Annotated[
    str | None, typer.Argument(metavar="[PATTERN]", help="Only changes of this, e.g. '(on ?x table)' or '(weight ?x)'.")
]
TOGETHER = 1000
"""Number of changes that one read returns."""
POLL_S = 0.1
"""Time in seconds between two reads of a store that other processes write."""


def query(
    source: Source,
    expression: Expr,
    domain: Domain = None,
    param: Params = None,
    explain: Explain = False,
    limit: Limit = None,
    seconds: Seconds = None,
    json: Json = False,
) -> None:
    """List the values of EXPR's variables that make it true, e.g. '(and (on ?o table1) (cup ?o))'."""
    with opened(source, domain) as (kb, _):
        if not explain:
            _answer(kb, expression, _params(param), limit, seconds, as_json=json)
            return
        plan = kb.explain_query(_parse(expression), _params(param))
    if json:
        print_json(asdict(plan))
    else:
        typer.echo(str(plan))


def ask(
    source: Source,
    expression: Question,
    domain: Domain = None,
    param: Params = None,
    why: Why = False,
    seconds: Seconds = None,
    json: Json = False,
) -> None:
    """Answer whether EXPR is true. Exit status: 0 yes, 1 no."""
    from knowledge_base.language.evaluation.world_protocol import Bounds

    with opened(source, domain) as (kb, _):
        explanation = kb.explain(_parse(expression), _params(param), bounds=Bounds(seconds=seconds))
    if json:
        print_json({"holds": explanation.truth, "why": explanation.to_json()})
    else:
        typer.echo("yes" if explanation.truth else "no")
        if why:
            typer.echo("\n".join(explanation.lines()))
    raise typer.Exit(0 if explanation.truth else NO)


def show(
    source: Source,
    thing: Annotated[str | None, typer.Argument(metavar="[THING]", help="Only facts about this thing.")] = None,
    domain: Domain = None,
    json: Json = False,
) -> None:
    """Show a world's objects, facts and function values, and a problem's goal; or only the facts about THING."""
    with opened(source, domain) as (kb, problem):
        _show(kb, problem, thing, as_json=json)


def at(
    store: Store,
    when: Annotated[str, typer.Argument(metavar="WHEN", help="A version, or a time such as 2026-11-21T16:40.")],
    expression: Annotated[
        str | None, typer.Argument(metavar="[EXPR]", help="Query this instead of showing everything.")
    ] = None,
    param: Params = None,
    limit: Limit = None,
    seconds: Seconds = None,
    json: Json = False,
) -> None:
    """Show a past world of a store, or query it."""
    with opened_store(store) as kb:
        then = kb.at(**moment(when))
        if expression is None:
            _show(then, None, None, as_json=json)
        else:
            _answer(then, expression, _params(param), limit, seconds, as_json=json)


def history(
    store: Store,
    pattern: Pattern = None,
    since: Annotated[int | None, typer.Option(metavar="VERSION", help="Only later changes.")] = None,
    until: Annotated[int | None, typer.Option(metavar="VERSION", help="Only changes up to this one.")] = None,
    json: Json = False,
) -> None:
    """List each change with its time and author."""
    with opened_store(store) as kb:
        touches = _touches(kb, pattern)
        changes = filter(touches, _changes(kb, kb.oldest if since is None else since, until))
        if json:
            print_json_list(map(change_form, changes))
            return
        rows = ([c.version, clock_time(c.time), c.author, "\n".join(delta_lines(c.delta))] for c in changes)
        print_table(["version", "time", "author", "change"], rows)


def check(store: Store, json: Json = False) -> None:
    """Check that the knowledge of a store is complete and unchanged; reads every row. For runs: `dsc runs check`."""
    from knowledge_base.journal.archive import Archive

    archive = Archive(store.resolve(), None)
    last = archive.require_all()
    if json:
        print_json({"oldest": archive.oldest(), "newest": last})
        return
    typer.echo(f"versions {archive.oldest()} to {last}: as they were written")


def watch(
    store: Store,
    pattern: Pattern = None,
    count: Annotated[int | None, typer.Option(min=1, help="End after this number of changes.")] = None,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="End after this number of seconds.")] = None,
    json: Json = False,
) -> None:
    """Print the changes that other processes commit, until Ctrl-C."""
    with opened_store(store) as kb:
        touches, left = _touches(kb, pattern), count
        end = None if seconds is None else time.monotonic() + seconds

        def print_change(change: Change) -> None:
            nonlocal left
            if left != 0 and touches(change):
                _print(change, as_json=json)
                left = None if left is None else left - 1

        kb.subscribe(print_change)
        while left != 0 and (end is None or time.monotonic() < end):
            kb.refresh()
            time.sleep(POLL_S)


def _answer(
    world: View,
    expression: str,
    params: Mapping[str, Value],
    limit: int | None,
    seconds: float | None,
    *,
    as_json: bool,
) -> None:
    """Print each answer when it is found; the answers are never all in memory."""
    from knowledge_base.language.evaluation.world_protocol import Bounds
    from knowledge_base.language.syntax.expression import variables_in_order

    condition = _parse(expression)
    answers = world.stream(condition, params, bounds=Bounds(seconds=seconds))
    answers = islice(answers, limit)
    names = [name for name in dict.fromkeys(variables_in_order(condition)) if name not in params]
    first = list(islice(answers, 1))  # report an error in the query before any output
    answers = chain(first, answers)
    if as_json:
        print_json_list(answers, {"variables": names, "holds": bool(first)}, "answers")
    elif names:
        print_table([f"?{n}" for n in names], ([answer[n] for n in names] for answer in answers))
    else:
        typer.echo("yes" if first else "no")


def _show(world: View, problem: ProblemText | None, thing: str | None, *, as_json: bool) -> None:
    from knowledge_base.language.syntax.text import to_text

    things, facts, values = world.nodes(), world.facts(), world.values()
    if thing is not None:
        if thing not in things:
            raise UnknownNameError(f"there is no object '{thing}'", found=thing, valid=things)
        facts = [fact for fact in facts if thing in fact.args]
        values = {fluent: number for fluent, number in values.items() if thing in fluent.args}
        others = {arg for fact in (*facts, *values) for arg in fact.args}
        things = {name: own for name, own in things.items() if name == thing or name in others}
    if as_json:
        said: dict[str, Any] = {"version": world.version}
        if problem is not None:
            said = {"problem": problem.name, "domain": problem.domain, "goal": to_text(problem.goal)}
        contents = {str(fluent): content for fluent, content in values.items()}
        print_json({**said, "objects": things, "facts": [str(f) for f in facts], "values": contents})
        return
    print_table(["thing", "type"], list(things.items()))
    print_table(["fact"], [[f] for f in facts])
    if values:
        print_table(["function", "value"], [[f, value_text(v, quoted=isinstance(v, str))] for f, v in values.items()])
    typer.echo(f"version {world.version}" if problem is None else f"goal: {to_text(problem.goal)}")


def _parse(expression: str) -> Expression:
    from knowledge_base.language.syntax.text import parse_condition

    return parse_condition(expression, source="EXPR")


def _params(said: list[str] | None) -> dict[str, Value]:
    """Return the bindings of the options `x=VALUE`; values have the notation of the language."""
    from knowledge_base.language.syntax.expression import Constant
    from knowledge_base.language.syntax.text import parse_term

    found: dict[str, Value] = {}
    for one in said or ():
        name, sign, text = one.partition("=")
        value = parse_term(text, source=f"--param {name}") if sign and text else None
        if not isinstance(value, Constant):
            raise InputError(f"a parameter is written x=VALUE, not '{one}'")
        found[name.removeprefix("?")] = value.value
    return found


def _changes(kb: KnowledgeBase, since: int, until: int | None) -> Iterator[Change]:
    """Yield the changes of a store, read in several blocks."""
    last = kb.version if until is None else until
    kb.changes(last, last)  # report a wrong version before the first change
    yield from kb.changes(since, min(last, since + TOGETHER))
    for first in range(since + TOGETHER, last, TOGETHER):
        yield from kb.changes(first, min(last, first + TOGETHER))


def _touches(kb: KnowledgeBase, pattern: str | None) -> Callable[[Change], bool]:
    from knowledge_base.conditions.watch import touches
    from knowledge_base.language.syntax.text import parse_condition

    return (lambda _: True) if pattern is None else touches(parse_condition(pattern, "PATTERN"), {}, kb.schema)


def _print(change: Change, *, as_json: bool) -> None:
    if as_json:
        print_line(change_form(change))
        return
    typer.echo(f"version {change.version}, {clock_time(change.time)}, {change.author}")
    for line in delta_lines(change.delta):
        typer.echo(f"  {printable(line)}")
