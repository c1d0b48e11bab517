"""Stores are damaged in every way there is, and every reader is asked: no answer is wrong without an error.

`python tests/support/stores_soak.py N [FIRST]` damages stores with the seeds FIRST to FIRST + N - 1. A store that was
closed answers as before or with an error of ours. One that was not closed may lack its end, as after a power cut, and
answers as it did at an earlier moment.
"""

from __future__ import annotations

import json
import shutil
import signal
import sqlite3
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from dsc_crashes import Robot, Run, copied
from dsc_kept_charts import CHARTS
from typer.testing import CliRunner

from dsc.cli.runs import app
from dsc.runs.archive import archive, has_run
from dsc.sequencer.replay import replay
from dsc.viewer.record_sources import records_of
from knowledge_base.errors import DamagedStoreError, InputError
from knowledge_base.exchange import schema_form, world_form
from knowledge_base.facts import Delta, fact
from knowledge_base.journal import journal
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

SECONDS = 5
"""After so many of work a reader hangs."""
WAITING = 60
"""After so many seconds it hangs, whether it works or not; other programs may be at work as well."""
PAGE = 4096
VERSIONS = 5
"""How many past worlds of a store are asked for."""
NAME = "run.kb"
CHART = CHARTS["variables, tells and guards"]
ITEMS = Schema.parse("(define (domain d) (:types item - object) (:predicates (seen ?i - item) (p) (q) (told)))")
MORE = Schema.parse(
    "(define (domain d) (:types item - object) (:constants zed - item)"
    " (:predicates (seen ?i - item) (p) (q) (told) (late ?i - item)))"
)
TABLES = ("schemas", "changes", "snapshots", "keys", "ends", "runs", "steps", "forms", "fence")


class WrongError(Exception):
    """A reader answered something that was never so."""


class HangError(BaseException):
    """A reader does not come to an end."""


# -- what readers answer ------------------------------------------------------------------------------------


def knowledge(path: Path) -> dict[str, Any]:
    with KnowledgeBase.open(None, path, read_only=True) as kb:
        step = max(1, (kb.version - kb.oldest) // VERSIONS)
        asked = {*range(kb.oldest, kb.version, step), kb.version}
        changes = kb.changes(kb.oldest)
        return {
            "oldest": kb.oldest, "schema": json.dumps(schema_form(kb.schema)), "now": _world(kb.snapshot()),
            "worlds": {version: _world(kb.at(version=version).snapshot()) for version in asked},
            "changes": [(one.version, one.author, repr(one.delta), one.time) for one in changes],
            "times": {one.version: kb.at(time=one.time).version for one in changes if one.version in asked},
        }  # fmt: skip


def _world(snapshot: Any) -> str:
    form = world_form(snapshot)
    form["nodes"].pop("zed", None)  # a constant of the longer schema, which is in every world that is read with it
    return json.dumps(
        {part: sorted(map(str, said.items() if isinstance(said, dict) else said)) for part, said in form.items()}
    )


def runs(path: Path) -> list[tuple[Any, tuple[Any, ...]]]:
    if not has_run(path):
        return []
    with archive(path) as kept:
        found = [(row, tuple(kept.steps(row.number))) for row in kept.runs()]
        for row in kept.runs():
            kept.last(row.number)
            for digest in row.plots.values():
                kept.form(digest)
        kept.latest_snapshot()
        return found


def commands(path: Path) -> list[str]:
    said = []
    for command in (["list"], ["show", "--json"], ["replay"], ["check"]):
        done = CliRunner().invoke(app, [command[0], str(path), *command[1:]])
        if done.exception is not None and not isinstance(done.exception, SystemExit):
            raise done.exception
        if done.exit_code == 1:
            raise WrongError(f"{command[0]} says {done.output}")
        said.append(done.output)
    return said


def viewed(path: Path) -> list[str]:
    with records_of(path) as log:
        return [log.line(seq) for seq in range(1, len(log) + 1)]


# -- stores to be damaged -----------------------------------------------------------------------------------


@dataclass
class Original:
    """A store with what it answers.

    Attributes:
        name: which it is.
        folder: of its files.
        closed: whether its writer has closed it.
        resume: goes on with its run in a folder, and raises `WrongError` if that ends otherwise than it should.
        earlier: folders with the same store as it was before.
        earlier_file: whether one of these files has taken its place.
    """

    name: str
    folder: Path
    closed: bool
    resume: Callable[[Path], None] | None = None
    earlier: list[Path] = field(default_factory=list)
    answers: dict[str, Any] = field(default_factory=dict)
    keys: dict[str, int] = field(default_factory=dict)
    schemas: set[str] = field(default_factory=set)
    earlier_file: bool = False

    @property
    def store(self) -> str:
        """Which store it is, at whatever moment."""
        return self.name.partition(",")[0]

    def learn(self, scratch: Path) -> Original:
        """Ask every reader while all is well."""
        folder = copied(self.folder, scratch)
        path = folder / NAME
        self.answers["knowledge"] = knowledge(path)
        with KnowledgeBase.open(None, path, read_only=True) as kb:
            for version in range(kb.oldest, kb.version + 1):
                self.answers["knowledge"]["worlds"][version] = _world(kb.at(version=version).snapshot())
                time_ = kb.changes(version - 1, version)[0].time if version > kb.oldest else None
                if time_ is not None:
                    self.answers["knowledge"]["times"][version] = kb.at(time=time_).version
        self.answers["runs"] = runs(path)
        self.answers["commands"] = commands(path) if self.answers["runs"] else []
        self.answers["viewed"] = viewed(path)
        self.schemas |= {self.answers["knowledge"]["schema"], json.dumps(schema_form(ITEMS))}
        with closing(sqlite3.connect(path)) as connection:
            self.keys = dict(connection.execute("SELECT key, version FROM keys"))
        shutil.rmtree(folder)
        return self


def originals(folder: Path, *, table: bool = False) -> list[Original]:
    """All of them; those of the clean-up table take seconds to make."""
    made = [
        *_knowledge_stores(folder / "knowledge", 60 if table else 12),
        *_small_runs(folder / "small", 1),
        *_small_runs(folder / "other", 2),
    ]
    if table:
        made += _table_runs(folder / "table")
    return [one.learn(folder / f"learn{number}") for number, one in enumerate(made)]


def _knowledge_stores(folder: Path, changes: int) -> list[Original]:
    """With keys, snapshots, a longer schema; closed, not closed, compacted."""
    made, earlier, was = [], [], journal.SNAPSHOT_AFTER
    journal.SNAPSHOT_AFTER = 50 * changes  # so that there are some
    try:
        for number in (1, 2):
            home = folder / f"store{number}"
            home.mkdir(parents=True)
            clock = iter(map(float, range(10**6)))
            with KnowledgeBase.open(ITEMS, home / NAME, clock=partial(next, clock)) as kb:
                for n in range(changes):
                    kb.apply(
                        Delta(nodes={f"i{number}-{n}": "item"}, added=(fact("seen", f"i{number}-{n}"),)),
                        "a",
                        key=f"k{n}" if n % 7 == 0 else None,
                    )
                    if n in (changes // 3, changes // 2):
                        earlier.append(copied(home, folder / f"earlier{number}-{n}"))
                kb.apply(Delta(), "a", key="empty")
            with KnowledgeBase.open(MORE, home / NAME, clock=partial(next, clock)) as kb:
                for n in range(changes // 3):
                    kb.apply(Delta(added=(fact("late", f"i{number}-{n}"),)), "b")
                open_ = copied(home, folder / f"open{number}")
                made.append(Original(f"knowledge {number}, not closed", open_, closed=False, earlier=earlier[-2:]))
                if number == 1:
                    kb.compact(keep_since=changes + 2)
                    kb.apply(Delta(added=(fact("p"),)), "c", key="after")
                    made.append(
                        Original("knowledge 1, compacted, not closed", copied(home, folder / "compacted"), closed=False)
                    )
            made.append(Original(f"knowledge {number}, closed", home, closed=True, earlier=earlier[-2:]))
    finally:
        journal.SNAPSHOT_AFTER = was
    return made


def _small_runs(folder: Path, times: int) -> list[Original]:
    """Runs of a small chart; `times` of them in one store, the last one also as it was on its way."""
    alive = folder / "alive"
    alive.mkdir(parents=True)
    for _ in range(times - 1):
        Run(alive, [CHART])
    copies: list[tuple[dict[str, int], Path]] = []
    robot = Robot()

    def crash(what: str) -> None:
        copies.append((dict(robot.done), copied(alive, folder / f"copy{len(copies)}")))

    whole = Run(alive, [CHART], robot=robot, crash=crash)
    done, middle = copies[len(copies) // 2 + 1]

    def resume(home: Path) -> None:
        run = Run(home, [CHART], robot=Robot(done), resume=True)
        if run.outcome() != whole.outcome():
            raise WrongError("the resumed run ends otherwise")

    earlier = [path for _, path in copies[1:3]]
    return [
        Original(f"{times} small runs, finished", alive, closed=True, earlier=[middle]),
        Original(f"{times} small runs, interrupted", middle, closed=False, resume=resume, earlier=earlier),
    ]


def _table_runs(folder: Path) -> list[Original]:
    """Runs of the clean-up table: finished, and interrupted before and after the log was put into the file."""
    from domains.clean_up_table.bringup import bundle, deploy
    from domains.clean_up_table.scenario import Scenario
    from planning import resume as deploy_again

    alive = folder / "alive"
    alive.mkdir(parents=True)
    copies: list[Path] = []
    with deploy(Scenario.parse("table: {cups: 1, cans: 1, crisp_cans: [small]}"), 3, 0.2, store=alive / NAME) as table:

        def boundary(what: str) -> None:
            copies.append(alive)
            if what == "after commit" and len(copies) in (20, 40, 60):
                copied(alive, folder / f"at{len(copies)}")
            if what == "after commit" and len(copies) == 70:
                with closing(sqlite3.connect(alive / NAME)) as connection:
                    connection.execute("PRAGMA wal_checkpoint(PASSIVE)")
            if what == "after commit" and len(copies) == 80:
                copied(alive, folder / f"at{len(copies)}")

        report = table.report(prepare=lambda run: run.store.writing.listen(boundary))

    def resume(home: Path) -> None:
        with deploy_again(bundle(), home / NAME) as table:
            again = table.report()
        if again.goal_reached != report.goal_reached or replay(home / NAME).divergence:
            raise WrongError("the resumed run ends otherwise")

    at = [folder / f"at{number}" for number in (20, 40, 60, 80)]
    found = [Original("table, finished", alive, closed=True, earlier=[at[2]])]
    for number, home in enumerate(at[1:], 1):
        found.append(Original(f"table, interrupted {number}", home, closed=False, resume=resume, earlier=at[:number]))
    return found


# -- damage -------------------------------------------------------------------------------------------------

Damage = Callable[[Path, Original, list[Original], Random], str]


def truncated(path: Path, one: Original, others: list[Original], random: Random) -> str:
    size = random.randrange(path.stat().st_size)
    with path.open("r+b") as file:
        file.truncate(size)
    return f"{path.name} truncated at {size}"


def truncated_log(path: Path, one: Original, others: list[Original], random: Random) -> str:
    log = path.with_name(NAME + "-wal")
    return (
        truncated(log, one, others, random)
        if log.exists() and log.stat().st_size
        else truncated(path, one, others, random)
    )


def no_log(path: Path, one: Original, others: list[Original], random: Random) -> str:
    path.with_name(NAME + "-wal").unlink(missing_ok=True)
    return "-wal removed"


def flipped(path: Path, one: Original, others: list[Original], random: Random) -> str:
    log = path.with_name(NAME + "-wal")
    file = log if log.exists() and log.stat().st_size and random.random() < 0.3 else path
    content = bytearray(file.read_bytes())
    begin = random.randrange(len(content)) // PAGE * PAGE
    # the head of a page and the cells at its end say most
    within = random.choice([random.randrange(PAGE), random.randrange(120)])
    bits: list[int] = []
    for _ in range(random.choice([1, 1, 1, 4])):
        at = min(len(content) - 1, begin + within + random.randrange(8) * (len(bits) > 0))
        content[at] ^= 1 << random.randrange(8)
        bits.append(at)
    file.write_bytes(content)
    return f"{file.name} flipped at {bits}"


def zeroed(path: Path, one: Original, others: list[Original], random: Random) -> str:
    content = bytearray(path.read_bytes())
    page = random.randrange(len(content) // PAGE)
    content[page * PAGE : (page + 1) * PAGE] = bytes(PAGE)
    path.write_bytes(content)
    return f"page {page + 1} zeroed"


def swapped(path: Path, one: Original, others: list[Original], random: Random) -> str:
    content = path.read_bytes()
    pages = [content[at : at + PAGE] for at in range(0, len(content), PAGE)]
    a, b = random.sample(range(len(pages)), 2)
    pages[a], pages[b] = pages[b], pages[a]
    path.write_bytes(b"".join(pages))
    return f"pages {a + 1} and {b + 1} swapped"


def page_of_another(path: Path, one: Original, others: list[Original], random: Random) -> str:
    content = bytearray(path.read_bytes())
    source = random.choice([other.folder / NAME for other in others] + [folder / NAME for folder in one.earlier])
    other = source.read_bytes()
    page = random.randrange(min(len(content), len(other)) // PAGE)
    content[page * PAGE : (page + 1) * PAGE] = other[page * PAGE : (page + 1) * PAGE]
    path.write_bytes(content)
    return f"page {page + 1} of {source.parent.name}"


def log_of_another(path: Path, one: Original, others: list[Original], random: Random) -> str:
    strangers = [other for other in others if other.store != one.store]  # a later log of its own is a later moment
    logs = [log for other in strangers for log in [other.folder / f"{NAME}-wal"] if log.exists() and log.stat().st_size]
    logs += [log for folder in one.earlier for log in [folder / f"{NAME}-wal"] if log.exists()]
    log = random.choice(logs)
    shutil.copy(log, path.with_name(NAME + "-wal"))
    one.closed = one.closed and log.parent not in one.earlier  # its own is a way back to what was then
    return f"-wal of {log.parent.name}"


def file_of_earlier(path: Path, one: Original, others: list[Original], random: Random) -> str:
    if not one.earlier:
        return page_of_another(path, one, others, random)
    source = random.choice(one.earlier)
    shutil.copy(source / NAME, path)
    one.closed, one.earlier_file = False, True  # so it is as it was then, with what was forgotten since
    return f"main file of {source.name} beside the -wal"


def edited(path: Path, one: Original, others: list[Original], random: Random) -> str:
    """Rows and tables, as a person with a database program edits them."""
    with suppress(sqlite3.Error), closing(sqlite3.connect(path, isolation_level=None)) as connection:
        there = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        table = random.choice([name for name in TABLES if name in there])
        return _EDITS[random.choice(list(_EDITS))](connection, table, one, others, random)
    return "nothing"


def _row(connection: sqlite3.Connection, table: str, random: Random) -> tuple[str, Any]:
    key = {"ends": "chain", "forms": "hash"}.get(table, "rowid")
    keys = [found for (found,) in connection.execute(f"SELECT {key} FROM {table} ORDER BY 1")]
    return key, random.choice(keys) if keys else None


def _column(connection: sqlite3.Connection, table: str, random: Random) -> str:
    return random.choice([str(row[1]) for row in connection.execute(f"PRAGMA table_info({table})")])


def _deleted(connection, table, one, others, random):
    key, row = _row(connection, table, random)
    connection.execute(f"DELETE FROM {table} WHERE {key} = ?", (row,))
    return f"{table} {row} deleted"


def _tail_deleted(connection, table, one, others, random):
    if not one.closed and table == "steps":  # nothing in the file says that there were more: see the docs
        return "nothing"
    key, row = _row(connection, table, random)
    connection.execute(f"DELETE FROM {table} WHERE {key} >= ?", (row,))
    return f"{table} deleted from {row} on"


def _changed(connection, table, one, others, random):
    key, row = _row(connection, table, random)
    column = _column(connection, table, random)
    found = connection.execute(f"SELECT {column} FROM {table} WHERE {key} = ?", (row,)).fetchone()
    if found is None:
        return "nothing"
    connection.execute(f"UPDATE OR REPLACE {table} SET {column} = ? WHERE {key} = ?", (_other(found[0], random), row))
    return f"{table}.{column} of {row} changed"


def _other(value: Any, random: Random) -> Any:
    """Another value, most often of the same kind."""
    wild = random.random()
    if wild < 0.15:
        return random.choice(
            [None, b"\xff\xfe", "\udcff".encode("utf-8", "surrogateescape"), 2**62, "", "{", "[]", 1.5]
        )
    if isinstance(value, str) and value:
        at = random.randrange(len(value))
        return value[:at] + random.choice('0123456789az"{}') + value[at + 1 :]
    if isinstance(value, bytes):
        return bytes(len(value)) if random.random() < 0.5 else value[::-1]
    return value + random.choice([1, -1, 1000]) if isinstance(value, int | float) else "x"


def _exchanged(connection, table, one, others, random):
    key, a = _row(connection, table, random)
    _, b = _row(connection, table, random)
    column = _column(connection, table, random)
    values = [connection.execute(f"SELECT {column} FROM {table} WHERE {key} = ?", (row,)).fetchone() for row in (a, b)]
    if None in values or a == b:
        return "nothing"
    for row, (value,) in zip((b, a), values, strict=True):
        connection.execute(f"UPDATE OR IGNORE {table} SET {column} = ? WHERE {key} = ?", (value, row))
    return f"{table}.{column} of {a} and {b} exchanged"


def _doubled(connection, table, one, others, random):
    key, row = _row(connection, table, random)
    columns = [found[1] for found in connection.execute(f"PRAGMA table_info({table})")]
    rest = ", ".join(columns[1:]) if columns[1:] else columns[0]
    connection.execute(f"INSERT OR IGNORE INTO {table} ({rest}) SELECT {rest} FROM {table} WHERE {key} = ?", (row,))
    return f"{table} {row} doubled"


def _dropped(connection, table, one, others, random):
    connection.execute(f"DROP TABLE {table}")
    return f"{table} dropped"


def _emptied(connection, table, one, others, random):
    if not one.closed and table in ("changes", "keys"):  # as in `_tail_deleted`: an earlier moment
        return "nothing"
    connection.execute(f"DELETE FROM {table}")
    return f"{table} emptied"


def _of_another(connection, table, one, others, random):
    source = random.choice([other for other in others if other.closed])
    connection.execute("ATTACH ? AS other", (str(source.folder / NAME),))
    connection.execute(f"DELETE FROM {table}")
    connection.execute(f"INSERT INTO {table} SELECT * FROM other.{table}")
    return f"{table} of {source.name}"


_EDITS: dict[str, Callable[..., str]] = {
    name.__name__: name
    for name in (_deleted, _tail_deleted, _changed, _changed, _exchanged, _doubled, _dropped, _emptied, _of_another)
}
DAMAGES: list[Damage] = [
    truncated, truncated_log, truncated_log, no_log, flipped, flipped, flipped, flipped, zeroed, swapped, page_of_another,
    log_of_another, file_of_earlier, edited, edited, edited, edited,
]  # fmt: skip


# -- the judgement ------------------------------------------------------------------------------------------


class Judge:
    """Damages stores and asks all readers.

    Attributes:
        verdicts: how often readers answered what.
        wrong: what must not be.
    """

    def __init__(self, stores: list[Original], folder: Path) -> None:
        self.stores = stores
        self.verdicts: Counter[str] = Counter()
        self.wrong: list[str] = []
        self._folder = folder

    def damage(self, seed: int) -> None:
        random = Random(f"damage {seed}")
        stored = self.stores[seed % len(self.stores)]
        others = [other for other in self.stores if other is not stored]
        one = replace(stored)
        folder = copied(one.folder, self._folder / f"damaged{seed}")
        how = random.choice(DAMAGES)(folder / NAME, one, others, random)
        questions: dict[str, Callable[[Path], object]] = {
            "knowledge": lambda path: self._knowledge(one, path), "runs": lambda path: self._runs(one, path),
            "commands": lambda path: self._commands(one, path), "viewer": lambda path: self._viewed(one, path),
            "writer": lambda path: self._written(one, path),
        }  # fmt: skip
        resume = one.resume
        if resume is not None:
            questions["resume"] = lambda path: resume(path.parent)
        verdicts = []
        for question, ask in questions.items():
            copy = copied(folder, self._folder / f"asked{seed}")
            try:
                with _limited():
                    ask(copy / NAME)
                verdicts.append("answered")
            except DamagedStoreError:
                verdicts.append("damaged")
            except InputError:
                verdicts.append("refused")
            except (WrongError, HangError) as error:
                self.wrong.append(f"seed {seed}: {one.name}, {how}, {question}: {type(error).__name__} {error}")
            except Exception:  # noqa: BLE001  a traceback is what is looked for
                self.wrong.append(f"seed {seed}: {one.name}, {how}, {question}: {traceback.format_exc(limit=-4)}")
            shutil.rmtree(copy)
        shutil.rmtree(folder)
        self.verdicts.update(set(verdicts) if len(set(verdicts)) == 1 else {"some readers refuse"})

    def _knowledge(self, one: Original, path: Path, found: dict[str, Any] | None = None) -> None:
        found = found or knowledge(path)
        was = one.answers["knowledge"]
        if one.closed and found["changes"] != was["changes"]:
            raise WrongError("changes are missing")
        if found["schema"] not in (one.schemas if not one.closed else {was["schema"]}):
            raise WrongError("another schema")
        if one.earlier_file and found["oldest"] < was["oldest"]:
            if any(was["worlds"].get(version, world) != world for version, world in found["worlds"].items()):
                raise WrongError("another world")
            return
        if found["oldest"] != was["oldest"] or found["changes"] != was["changes"][: len(found["changes"])]:
            raise WrongError("another history")
        for part in ("worlds", "times"):
            if not found[part].items() <= was[part].items():
                raise WrongError(f"other {part}")
        last = found["oldest"] + len(found["changes"])
        if found["now"] != was["worlds"][last]:
            raise WrongError("another world")

    def _runs(self, one: Original, path: Path) -> None:
        found, was = runs(path), one.answers["runs"]
        if one.closed and found != was:
            raise WrongError("other runs")
        if len(found) > len(was):
            raise WrongError("a run that never was")
        for number, ((row, steps), (row_was, steps_was)) in enumerate(zip(found, was, strict=False), 1):
            same = row == row_was or (number == len(found) and row.ended is None)
            if not same or steps != steps_was[: len(steps)] or (row.ended is not None and steps != steps_was):
                raise WrongError(f"run {number} is another")

    def _commands(self, one: Original, path: Path) -> None:
        said = commands(path) if has_run(path) else []
        if one.closed and said != one.answers["commands"]:
            raise WrongError(f"the commands say {said}")

    def _viewed(self, one: Original, path: Path) -> None:
        said = viewed(path)
        if one.closed and said != one.answers["viewed"]:
            raise WrongError("the page shows something else")

    def _written(self, one: Original, path: Path) -> None:
        with KnowledgeBase.open(None, path) as kb:
            last, before = kb.version, kb.changes(kb.oldest)
            for key, version in one.keys.items():
                if one.closed and kb.apply(Delta(), "again", key=key).version != version:
                    raise WrongError(f"the key {key} is forgotten")
            kb.apply(Delta(nodes={"quite-new": _item(kb)}), "new")
        after = knowledge(path)
        if after["changes"][-1][:2] != (last + 1, "new"):
            raise WrongError("a change is not where it was made")
        with KnowledgeBase.open(None, path, read_only=True) as kb:
            if kb.changes(kb.oldest, last) != before:
                raise WrongError("writing has changed what was there")
            past = kb.at(version=last).snapshot()
        known = {"worlds": {}, "times": {}, "now": _world(past), "changes": after["changes"][:-1]}
        self._knowledge(one, path, after | known)


def _item(kb: KnowledgeBase) -> str:
    """A type of things."""
    return "item" if "item" in kb.schema.types else "cup"


@contextmanager
def _limited():
    def hang(*_: object) -> None:
        raise HangError("no answer in time")

    limits = ((signal.SIGPROF, signal.ITIMER_PROF, SECONDS), (signal.SIGALRM, signal.ITIMER_REAL, WAITING))
    before = [signal.signal(number, hang) for number, _, _ in limits]
    for _, timer, seconds in limits:
        signal.setitimer(timer, seconds)
    try:
        yield
    finally:
        for (number, timer, _), handler in zip(limits, before, strict=True):
            signal.setitimer(timer, 0)
            signal.signal(number, handler)


def main() -> None:
    number, first = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        judge = Judge(originals(Path(folder), table=True), Path(folder))
        print(f"{len(judge.stores)} stores: {', '.join(one.name for one in judge.stores)}")
        for seed in range(first, first + number):
            judge.damage(seed)
    print(f"{number} corruptions in {time.monotonic() - began:.0f} s: {dict(judge.verdicts)}")
    for wrong in judge.wrong:
        print(wrong)
    print(f"{len(judge.wrong)} wrong")
    sys.exit(1 if judge.wrong else 0)


if __name__ == "__main__":
    main()
