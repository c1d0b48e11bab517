"""SCION's own SCXML charts and its copies of the W3C's, with their event scripts, run on this engine.

`python tests/conformance/charts.py [--write]` fetches the npm package into `.conformance/` if it is not there,
prints the scores, and with `--write` puts the tables into docs/conformance.md. Exit status 1: a chart fails.
"""

from __future__ import annotations

import heapq
import json
import subprocess
import sys
import tarfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.engine.steps import Revoke, SendLater, Step
from dsc.errors import NotExpressibleError
from dsc.events import Event
from dsc.model.plot import ActionPlot
from dsc.model.states import State
from dsc.scxml.reader import parse_scxml
from dsc.scxml.writer import to_scxml
from dsc.validation import raise_findings, validate_plot
from knowledge_base.errors import InputError
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

ROOT = Path(__file__).parents[2]
CACHE = ROOT / ".conformance"
PAGE = ROOT / "docs" / "conformance.md"
PACKAGE = "@scion-scxml/test-framework"
AGAINST_THE_STANDARD = {
    "internal-transitions/test0": "a `transition` directly in `scxml`, which has no such children (SCXML 3.2.2)",
}
"""Charts that are no SCXML documents, with the paragraph that says so."""
W3C = "w3c-ecma"
LONGEST = 60.0
"""Seconds after which nothing comes any more: the longest delay of the W3C's charts is shorter."""
OTHERWISE = (
    "expects that a child of `parallel` can be left alone; SCXML's LCCA is never a `parallel` (appendix D, 3.13)"
)
SCRIPT_AGAINST_THE_STANDARD = {"more-parallel/test10": OTHERWISE, "more-parallel/test10b": OTHERWISE}
"""Charts whose script contradicts the standard; their `legacySemantics` script, which does not, has to pass."""


@dataclass(frozen=True, slots=True)
class Result:
    """What became of one chart.

    Attributes:
        verdict: `passed`, `excluded` (because of the element, or of a mistake) or `failed`.
        crosses: whether transitions cross borders, which dialect `dsc` has to refuse.
    """

    name: str
    verdict: str
    element: str = ""
    reason: str = ""
    crosses: bool = False


@dataclass(slots=True)
class Player:
    """Plays a chart; events that it sends itself come at their time, in the order in which they were sent."""

    library: Library
    situation: Any
    now: float = 0.0
    machine: Machine = field(init=False)
    _due: list[tuple[float, int, SendLater]] = field(default_factory=list)
    _number: Iterator[int] = field(default_factory=count)
    _last: Step | None = None

    def __post_init__(self) -> None:
        self.machine = Machine(self.library)

    def start(self, plot: str) -> None:
        self._took(self.machine.start(plot, {}, self.situation()))
        self.until(self.now)

    def send(self, event: Event) -> None:
        self._took(self.machine.send(event, self.situation()))
        self.until(self.now)

    def until(self, time: float) -> None:
        while self._due and self._due[0][0] <= time:
            self.now, _, later = heapq.heappop(self._due)
            self._took(self.machine.send(later.event, self.situation()))
        self.now = time

    def _took(self, step: Step) -> None:
        self._last = step if step.moved else self._last
        for output in step.output:
            if isinstance(output, SendLater):
                heapq.heappush(self._due, (self.now + output.seconds, next(self._number), output))
            elif isinstance(output, Revoke):
                gone = output
                self._due = [due for due in self._due if (due[2].event.frame, due[2].id) != (gone.frame, gone.id)]
                heapq.heapify(self._due)

    @property
    def leaves(self) -> list[str]:
        """The innermost active states; those of the last configuration if the chart has ended."""
        assert self._last is not None
        ended = self.machine.state.finished
        active = set(self._last.microsteps[-1].exited if ended else self.machine.state.configuration())
        plot = next(iter(self.library))
        paths = {name: path for name, _, path in plot.walk()}
        return sorted(name for name in active if not any(_inside(paths[other], paths[name]) for other in active))


def _inside(inner: tuple[str | int, ...], outer: tuple[str | int, ...]) -> bool:
    return inner != outer and inner[: len(outer)] == outer


def fetch() -> Path:
    """The folder with the charts, fetched with npm the first time."""
    tests = CACHE / "package" / "test"
    if not tests.is_dir():
        CACHE.mkdir(exist_ok=True)
        subprocess.run(["npm", "pack", "--silent", PACKAGE], cwd=CACHE, check=True)  # noqa: S607
        with tarfile.open(next(CACHE.glob("*.tgz"))) as archive:
            archive.extractall(CACHE, filter="data")
    return tests


def charts(tests: Path) -> list[Path]:
    """SCION's own charts; its copies of the W3C's are not among them."""
    return sorted(file for file in tests.glob("*/*.scxml") if file.parent.name != W3C)


def w3c_charts(tests: Path) -> list[Path]:
    """The W3C's charts that have a script; the others are parts of them."""
    return sorted(file for file in (tests / W3C).glob("*.scxml") if file.with_suffix(".json").is_file())


def run_w3c(file: Path) -> Result:
    """Play one of the W3C's charts until nothing is due any more: it has to end in `pass`, as the W3C says.

    Of the script the events count. The configurations before the last one tell how long SCION takes to send.
    """
    name = file.name.partition(".")[0]
    try:
        player = _player(parse_scxml(file.read_text(encoding="utf-8"), str(file)), file)
    except NotExpressibleError as error:
        return Result(name, "excluded", error.element, error.message.removeprefix(f"{error.element}: "))
    except InputError as error:
        return Result(name, "excluded", "mistake", error.message)
    player.start(next(iter(player.library)).name)
    for entry in _script(file, standard=True)["events"]:
        player.until(player.now + entry.get("after", 0) / 1000)
        player.send(Event(entry["event"]["name"]))
    player.until(player.now + LONGEST)
    found = player.leaves
    return Result(name, "passed") if found == ["pass"] else Result(name, "failed", "", f"ends in {found}")


def _player(plot: ActionPlot, file: Path) -> Player:
    """A player of the plot after it was written as SCXML and read again; raises `InputError`."""
    plot = parse_scxml(to_scxml(plot), str(file))
    library = Library([plot])
    raise_findings(validate_plot(plot, library))
    knowledge = KnowledgeBase(Schema.parse("(define (domain none))"))
    return Player(library, lambda: KnowledgeSituation(knowledge, library))


def run(file: Path) -> Result:
    """Play one chart with its script."""
    name = f"{file.parent.name}/{file.stem}"
    if name in AGAINST_THE_STANDARD:
        return Result(name, "excluded", "no SCXML", AGAINST_THE_STANDARD[name])
    try:
        player = _player(parse_scxml(file.read_text(encoding="utf-8"), str(file)), file)
        plot = next(iter(player.library))
        crosses = _crosses(plot)
        refused = any(one.code == "no-border-crossing" for one in validate_plot(_strict(plot), player.library))
        if crosses != refused:
            return Result(name, "failed", "", f"crosses borders: {crosses}; refused by dialect dsc: {refused}")
        problem = play(player, plot.name, _script(file, standard=name not in SCRIPT_AGAINST_THE_STANDARD))
    except NotExpressibleError as error:
        return Result(name, "excluded", error.element, error.message.removeprefix(f"{error.element}: "))
    except InputError as error:
        problem = str(error)
    if problem:
        return Result(name, "failed", "", problem)
    if name in SCRIPT_AGAINST_THE_STANDARD:
        return Result(name, "excluded", "script", SCRIPT_AGAINST_THE_STANDARD[name])
    return Result(name, "passed", crosses=crosses)


def _crosses(plot: ActionPlot) -> bool:
    """Whether a target stands in another scope than its source."""
    scope_of = {name: number for number, scope in enumerate(plot.scopes()) for name in scope.states}
    return any(
        scope_of.get(name) != scope_of.get(target)
        for name, state, _ in plot.walk()
        if isinstance(state, State)
        for _, transition in state.transitions()
        for target in transition.targets
    )


def _strict(plot: ActionPlot) -> ActionPlot:
    return plot.model_copy(update={"dialect": "dsc"})


def _script(file: Path, *, standard: bool) -> dict[str, Any]:
    script: dict[str, Any] = json.loads(file.with_suffix(".json").read_text(encoding="utf-8"))
    legacy: dict[str, Any] = script.get("legacySemantics", script)
    return script if standard else legacy


def play(player: Player, plot: str, script: dict[str, Any]) -> str:
    """What differs first from what the script expects; empty if nothing does."""
    player.start(plot)
    expected = sorted(script["initialConfiguration"])
    if player.leaves != expected:
        return f"at first {player.leaves}, expected {expected}"
    for number, entry in enumerate(script["events"], start=1):
        player.until(player.now + entry.get("after", 0) / 1000)
        player.send(Event(entry["event"]["name"]))
        expected = sorted(entry["nextConfiguration"])
        if player.leaves != expected:
            return f"after event {number} {player.leaves}, expected {expected}"
    return ""


def table(results: list[Result]) -> str:
    """The published list of SCION's charts."""
    crossing = sum(one.crosses for one in results)
    told = f"{crossing} of those that pass cross borders of composites, and dialect dsc refuses each of them"
    return f"Score: {score(results)}; {told}.\n\n{_rows(results)}"


def w3c_table(results: list[Result]) -> str:
    """The published list of the W3C's charts, with the reasons counted."""
    reasons = Counter(one.element for one in results if one.verdict == "excluded")
    counted = "\n".join(f"| {element} | {number} |" for element, number in reasons.most_common())
    head = "| refused because of | charts |\n|---|---|"
    return f"Score: {score(results)}.\n\n{head}\n{counted}\n\n{_rows(results)}"


def _rows(results: list[Result]) -> str:
    rows = [f"| {one.name} | {one.verdict} | {one.element} | {one.reason.replace('|', '&#124;')} |" for one in results]
    return "\n".join(["| chart | verdict | element | why |", "|---|---|---|---|", *rows])


def score(results: list[Result]) -> str:
    """`passed/all`, and what became of the rest."""
    found = {verdict: sum(one.verdict == verdict for one in results) for verdict in ("passed", "excluded", "failed")}
    return f"{found['passed']}/{len(results)} pass, {found['excluded']} excluded, {found['failed']} fail"


def main() -> int:
    """Run all charts and say how it went."""
    tests = fetch()
    own = [run(file) for file in charts(tests)]
    w3c = [run_w3c(file) for file in w3c_charts(tests)]
    for one in (*own, *w3c):
        if one.verdict != "passed":
            print(f"{one.verdict:9} {one.name:40} {one.element} {one.reason}")
    print(f"SCION's charts: {score(own)}\nthe W3C's charts: {score(w3c)}")
    if "--write" in sys.argv[1:]:
        head, mark, _ = PAGE.read_text(encoding="utf-8").partition("<!-- results -->\n")
        body = f"## SCION's charts\n\n{table(own)}\n\n## The W3C's charts\n\n{w3c_table(w3c)}\n"
        PAGE.write_text(f"{head}{mark}{body}", encoding="utf-8")
    return 1 if any(one.verdict == "failed" for one in (*own, *w3c)) else 0


if __name__ == "__main__":
    sys.exit(main())
