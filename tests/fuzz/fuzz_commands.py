"""Every command of `dsc` with arguments of every kind; commands and options are read from the Typer app itself.

An input is a JSON object: `argv`, and `files` by name, which stand in an empty folder before the command runs there.
Only names inside that folder are ever given to a command: it may run as root, and outputs are written.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import typer
from fuzz_mutation import NAMES, NUMBERS, mutated
from fuzz_readers import READERS, Target, stores

from planning.cli.command import NO_READER, NOT_WRITTEN, app, main

STATUSES = {0, 1, 2, NOT_WRITTEN, NO_READER}
MORE_STATUSES = {("plan",): {3, 4}, ("kb", "watch"): {130}}
"""Of a planner whose time was up or whose engine failed; of what was interrupted."""
NEVER = {
    "--real-time": "time passes as on the wall, by intent",
    "--speed": "a low speed waits, by intent",
    "--install-completion": "it writes into the user's shell",
}
"""Options that are not drawn, and why."""
ALWAYS = {("plan",): ("--seconds", "1"), ("view",): ("--no-open",)}
"""Arguments that stand before what was drawn: a search may take the time that it is given."""
ENDINGS = {
    "plot": "yaml", "chart": "scxml", "profile": "yaml", "scenario": "yaml", "domain": "pddl", "fragment": "pddl",
    "problem": "pddl", "world": "json", "trace": "jsonl", "knowledge-store": "db", "run-store": "db", "deployment": "yaml",
    "monitoring": "yaml",
}  # fmt: skip
"""What files of commands are made of."""
WORDS = (
    "clean-up-table", "hurried", "on_wheels", "(on ?x ?y)", "(clean mug)", "(forall (?x) (clean ?x))", "(not (clean mug))",
    "mug", "table", "scxml", "mermaid", "plantuml", "svg", "json", "pddl", "pyperplan", "process", "power", "dsc:nothing",
    "domains.clean_up_table.bringup:bundle", "os:getcwd", "sys:exit", "-h", "--help", "--", "=", "@x",
)  # fmt: skip
MADE = (
    "out.svg",
    "out.yaml",
    "out.jsonl",
    "new.db",
    "out.pddl",
    "out.json",
    "none/out.yaml",
    "folder",
    "folder/x.yaml",
    ".",
    "..",
)


@cache
def commands() -> dict[tuple[str, ...], tuple[Any, ...]]:
    """The parameters of each command, by its words."""
    found: dict[tuple[str, ...], tuple[Any, ...]] = {}

    def walk(command: Any, words: tuple[str, ...]) -> None:
        for name, inner in getattr(command, "commands", {}).items():
            walk(inner, (*words, name))
        found[words] = tuple(command.params)

    walk(_command(), ())
    return found


@cache
def _command() -> Any:
    """The whole app, which Typer would build for each call."""
    return typer.main.get_command(app)


class Commands(Target):
    """The target whose input is a call."""

    def vary(self, random: Random) -> bytes:
        """A call from the corpus with other arguments, or one that was never made."""
        files: dict[str, str]
        if random.random() < 0.5:
            call = json.loads(random.choice(self.seeds()))
            words = tuple(call["argv"][: 2 if tuple(call["argv"][:2]) in commands() else 1])
            rest, files = list(call["argv"][len(words) :]), call.get("files", {})
            _change(rest, random, words, files)
        else:
            words = random.choice(list(commands()))
            files = {}
            rest = _drawn(random, words, files)
        for name in list(files):
            files[name] = _content(files[name], random)
        argv = [*words, *ALWAYS.get(words, ()), *(_inside(one) for one in rest if one not in NEVER)]
        return json.dumps({"argv": argv, "files": files}).encode()


def run_command(data: bytes, folder: Path) -> None:
    """Make the call, in the folder; raise for a traceback or an exit status that no command has."""
    call = json.loads(data)
    home = folder / "a" / "b"
    (home / "folder").mkdir(parents=True)
    for name, content in call.get("files", {}).items():
        (home / name).write_bytes(_bytes(content))
    argv = [str(one) for one in call["argv"]]
    status, said = _called(argv, home)
    allowed = STATUSES.union(*(more for words, more in MORE_STATUSES.items() if tuple(argv[: len(words)]) == words))
    if status not in allowed or "Traceback (most recent call last)" in said:
        raise AssertionError(f"exit status {status}: {said[-2000:]}")


def _called(argv: Sequence[str], home: Path) -> tuple[int, str]:
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    before = Path.cwd()
    os.chdir(home)
    try:
        with (
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(out),
            _nobody_waits(),
            patch("sys.argv", ["dsc", *argv]),
        ):
            main()
        status: Any = 0
    except SystemExit as ended:
        status = ended.code
    finally:
        os.chdir(before)
    out.flush()
    said = out.buffer.getvalue().decode("utf-8", "replace")
    return (0 if status is None else status if isinstance(status, int) else 1), said


@contextlib.contextmanager
def _nobody_waits() -> Iterator[None]:
    """What lasts until somebody presses Ctrl-C is over at once; no browser is opened; standard input is empty."""
    whole = _command()
    with (
        patch("typer.main.get_command", lambda _: whole),
        patch("dsc.cli.view.until_interrupt", lambda viewer: None),
        patch("webbrowser.open", lambda url: True),
        patch("knowledge_base.cli.queries.time", SimpleNamespace(sleep=_interrupted, monotonic=time.monotonic)),
        patch("sys.stdin", io.TextIOWrapper(io.BytesIO())),
        patch("sys.path", list(sys.path)),
    ):
        yield


def _interrupted(_: float) -> None:
    raise KeyboardInterrupt


def _drawn(random: Random, words: tuple[str, ...], files: dict[str, str]) -> list[str]:
    """Arguments by what the command declares, most of them once."""
    drawn: list[str] = []
    for one in commands()[words]:
        if one.param_type_name == "argument":
            for _ in range(random.choice((0, 1, 1, 1, 1, 2)) if one.nargs != -1 else random.randint(0, 3)):
                drawn.insert(random.randint(0, len(drawn)), _value(random, files))
        elif random.random() < 0.25:
            option = random.choice([*one.opts, *one.secondary_opts])
            drawn += [option] if one.is_flag and random.random() < 0.95 else [option, _value(random, files)]
    return drawn


def _change(argv: list[str], random: Random, words: tuple[str, ...], files: dict[str, str]) -> None:
    for _ in range(random.choice((0, 0, 1, 1, 2, 3))):
        at = random.randint(0, len(argv))
        match random.randrange(5):
            case 0 if argv:
                del argv[min(at, len(argv) - 1)]
            case 1 if argv:
                argv[min(at, len(argv) - 1)] = _value(random, files)
            case 2 if argv:
                argv.insert(at, random.choice(argv))
            case 3:
                argv.insert(at, _value(random, files))
            case _:
                argv += _drawn(random, words, files)[:3]


def _value(random: Random, files: dict[str, str]) -> str:
    chance = random.random()
    if chance < 0.45:
        kind = random.choice(list(ENDINGS))
        name = f"{kind}{random.choice(('', '', '2'))}.{ENDINGS[kind] if random.random() < 0.9 else random.choice(list(ENDINGS.values()))}"
        files.setdefault(name, f"seed {kind} {random.randrange(1000)}")
        return name
    if chance < 0.6:
        return random.choice(MADE)
    if chance < 0.7 and files:
        return random.choice(list(files))
    return random.choice(random.choice((WORDS, NUMBERS, NAMES)))


def _content(content: str, random: Random) -> str:
    """The content of a file: `seed KIND NUMBER` as it is, or mutated; anything else is text."""
    if not content.startswith("seed ") or random.random() < 0.5:
        return content
    target = _by_name()[content.split(" ")[1]]
    if target.form == "database":
        return content
    return _said(mutated(_bytes(content), random, target.seeds(), target.tokens(), target.form))


def _bytes(content: str) -> bytes:
    if not content.startswith("seed "):
        return content.encode("utf-8", "surrogateescape")
    _, kind, number = content.split(" ")
    target = _by_name()[kind]
    seeds = (stores()[kind.removesuffix("-store")],) if target.form == "database" else target.seeds()
    return seeds[int(number) % len(seeds)]


def _said(data: bytes) -> str:
    return data.decode("utf-8", "surrogateescape")


@cache
def _by_name() -> dict[str, Target]:
    return {target.name: target for target in READERS}


def _inside(argument: str) -> str:
    """The argument, unless it names something outside of the folder of the call."""
    outside = argument.startswith(("/", "~")) or "=/" in argument or argument.count("..") > 1
    return "x" + argument.replace("..", ".") if outside else argument.replace("\x00", "")


COMMANDS = Commands("command", run_command, share=9)
TARGETS = (*READERS, COMMANDS)
