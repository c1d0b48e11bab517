"""`dsc kb`: look into a world model from the command line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from knowledge_base.exchange.pddl import ProblemText
    from knowledge_base.store import KnowledgeBase

app = typer.Typer(
    rich_markup_mode=None,
    no_args_is_help=True,
    help="Look into a world model: ask what holds, show what is there.",
)

File = Annotated[Path, typer.Argument(metavar="FILE", help="A PDDL problem file.")]
Domain = Annotated[
    Path | None,
    typer.Option("--domain", metavar="D.pddl", help="Its domain.  [default: domain.pddl beside FILE]"),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]


@app.command()
def query(
    file: File,
    expression: Annotated[str, typer.Argument(metavar="EXPR", help="A condition; ?x is asked for.")],
    domain: Domain = None,
    json: Json = False,
) -> None:
    """Ask FILE's first state, e.g. '(and (on ?o table1) (cup ?o))'."""
    from knowledge_base.language.expression import variables_in_order
    from knowledge_base.language.parser import parse_condition

    condition = parse_condition(expression, source="EXPR")
    answers = _load(file, domain)[0].query(condition)
    names = list(dict.fromkeys(variables_in_order(condition)))
    if json:
        _print_json({"variables": names, "holds": bool(answers), "answers": answers})
    elif names:
        _print_table([f"?{n}" for n in names], [[answer[n] for n in names] for answer in answers])
    else:
        typer.echo("yes" if answers else "no")


@app.command()
def show(file: File, domain: Domain = None, json: Json = False) -> None:
    """Show FILE's things, facts and what functions are worth, and its goal."""
    from knowledge_base.language.printer import to_text, value_text

    kb, problem = _load(file, domain)
    facts, values, goal = kb.facts(), kb.values(), to_text(problem.goal)
    things = {name: kb.type_of(name) for name in kb.objects("object")}
    if json:
        contents = {str(fluent): content for fluent, content in values.items()}
        said = {"objects": things, "facts": [str(f) for f in facts], "values": contents, "goal": goal}
        _print_json({"problem": problem.name, "domain": problem.domain, **said})
        return
    _print_table(["thing", "type"], list(things.items()))
    _print_table(["fact"], [[f] for f in facts])
    if values:
        _print_table(["function", "value"], [[f, value_text(v, quoted=isinstance(v, str))] for f, v in values.items()])
    typer.echo(f"goal: {goal}")


def _load(file: Path, domain: Path | None) -> tuple[KnowledgeBase, ProblemText]:
    from knowledge_base.exchange.files import read_text
    from knowledge_base.exchange.pddl import read_problem
    from knowledge_base.schema import Schema
    from knowledge_base.store import KnowledgeBase

    read_text(file)  # what was asked for comes first: without it nobody cares for its domain
    schema = Schema.from_pddl(domain or _beside(file))
    problem = read_problem(file, schema)
    kb = KnowledgeBase(schema)
    kb.apply(problem.delta(), author=str(file))
    return kb, problem


def _beside(problem: Path) -> Path:
    from knowledge_base.errors import InputError

    domain = problem.parent / "domain.pddl"
    if not domain.exists():
        raise InputError(f"there is no '{domain}' beside the problem; name its domain with --domain")
    return domain


def _print_json(said: dict[str, Any]) -> None:
    import json

    typer.echo(json.dumps(said, indent=2))


def _print_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table()
    for title in head:
        table.add_column(Text(title))
    for row in rows:
        table.add_row(*(Text(str(cell)) for cell in row))
    Console().print(table)
