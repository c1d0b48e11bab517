"""Everything that reads what others wrote, as functions of bytes; each input is used as far as it can be used.

A reader returns, or raises one of `FINE`: any other exception is a finding.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterable
from functools import cache, partial
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from fuzz_mutation import mutated, reset

from domains.clean_up_table.bringup import bundle, deploy
from domains.clean_up_table.scenario import Scenario
from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.controllers import build_controller
from dsc.deployment.checks import check_deployment
from dsc.deployment.cores import cores_of
from dsc.deployment.diagram import draw_deployment
from dsc.deployment.model import load_deployment
from dsc.deployment.timeline import draw_worst_cases
from dsc.drawing import draw
from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.editing.surgery import Add, Edit, Move, Remove, RenameState, apply, differences, patch
from dsc.engine.machine import Machine
from dsc.engine.machine_forms import read_state
from dsc.errors import NotExpressibleError, RunawayError
from dsc.events import Event
from dsc.model.plot import ActionPlot
from dsc.monitoring.profile import load_monitoring
from dsc.outcomes import Outcome
from dsc.runs.archive import archive
from dsc.scxml.reader import parse_scxml
from dsc.scxml.writer import to_scxml
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.replay import replay
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from dsc.text.plot_files import load_plot, parse_plot, plot_to_yaml
from dsc.text.profiles import load_profile, parse_profile, profile_to_yaml
from dsc.text.text_diagrams import to_mermaid, to_plantuml
from dsc.text.yaml import read_file
from dsc.trace import Trace, header
from dsc.trees import load_trees, parse_trees, trees_to_xml
from dsc.validation import review_plot, validate_plot
from dsc.viewer.access import PageAddress
from dsc.viewer.control import Control
from dsc.viewer.queries import PageQueries
from dsc.viewer.record_sources import records_of
from dsc.viewer.records import RecordLog, read_trace
from dsc.viewer.server import Viewer
from dsc.wire.endpoint import LocalTransport
from dsc.wire.host import Host
from knowledge_base import InputError, KnowledgeBase, Schema
from knowledge_base.language.checking.check import check, check_effect
from knowledge_base.language.syntax.text import parse_condition, parse_effect, parse_term, to_text
from knowledge_base.pddl import read_problem
from knowledge_base.statements import retracted, told
from planning.execution.shipped_plots import shipped_plots
from planning.model.cancellable_work import WorkLimit, WorkLimitError
from planning.model.domain import PlanningDomain
from planning.problem.construction import build_problem

HOME = Path(__file__).parent
ROOT = HOME.parents[1]
LIBRARY = Library([*bundle().plots, *shipped_plots()])
DOMAIN = PlanningDomain.from_pddl(ROOT / "domains" / "clean_up_table" / "domain.pddl")
KITCHEN = ROOT / "examples" / "kitchen"
PATIENCE_S = 1.0
"""Seconds that a mutated problem may be posed: it says itself when they are over."""


class Target(NamedTuple):
    """A reader, or all commands.

    Attributes:
        name: that of its folder in `corpus`, and of its tokens.
        read: uses the bytes; the folder is its own, and empty.
        kept: patterns of files of the repository that are inputs besides its corpus.
        form: how inputs are mutated.
        share: of all inputs.
    """

    name: str
    read: Callable[[bytes, Path], None]
    kept: tuple[str, ...] = ()
    form: str = "text"
    share: int = 1

    def seeds(self) -> tuple[bytes, ...]:
        """What is mutated."""
        return _seeds(self)

    def tokens(self) -> tuple[bytes, ...]:
        """Words of the language."""
        return _tokens(self.name)

    def vary(self, random: Random) -> bytes:
        """A mutated input."""
        seeds = self.seeds()
        return mutated(random.choice(seeds), random, seeds, self.tokens(), self.form)


@cache
def _seeds(target: Target) -> tuple[bytes, ...]:
    files = sorted((HOME / "corpus" / target.name).glob("*"))
    files += [file for pattern in target.kept for file in sorted(ROOT.glob(pattern))]
    return tuple([file.read_bytes() for file in files if file.is_file()])


@cache
def _tokens(name: str) -> tuple[bytes, ...]:
    files = [HOME / "tokens" / f"{name}.txt"]
    return tuple(line for file in files if file.is_file() for line in file.read_bytes().splitlines() if line)


def _written(data: bytes, folder: Path, name: str) -> Path:
    file = folder / name
    file.write_bytes(data)
    return file


# -- plots and charts ------------------------------------------------------------------------------------


def read_plot(data: bytes, folder: Path) -> None:
    """A plot: validated, drawn, written in each form and read again, run for a few events."""
    plot = load_plot(_written(data, folder, "plot.yaml"))
    again = parse_plot(plot_to_yaml(plot))
    if again != plot:
        raise AssertionError(f"read again, it is another plot: {plot_to_yaml(again)}")
    plots = Library([plot, *(other for other in LIBRARY if other.name != plot.name)])
    findings = [str(one) for one in validate_plot(plot, plots, DOMAIN.schema)]
    draw(plot)
    for written in (to_mermaid, to_plantuml, to_scxml):
        _unless(NotExpressibleError, partial(written, plot))
    if not findings:
        [str(one) for one in review_plot(plot, plots)]
        draw(plot, plots)
        _run(plot, plots)


def read_chart(data: bytes, folder: Path) -> None:
    """A chart in SCXML: read, written, run for a few events."""
    plot = parse_scxml(read_file(_written(data, folder, "chart.scxml")), "chart.scxml")
    findings = validate_plot(plot, Library([plot]))
    if findings:
        return
    text = to_scxml(plot)
    parse_scxml(text)
    draw(plot)
    _run(plot, Library([plot]))


def _run(plot: ActionPlot, plots: Library) -> None:
    situation = partial(KnowledgeSituation, _table(), plots)
    machine = Machine(plots)
    machine.start(plot.name, {}, situation())
    names = [*plot.receives, "done", "timed_out", "every"]
    for name in names[:6]:
        machine.send(Event(name), situation())
        if machine.state.finished:
            return
    form = json.loads(json.dumps(machine.state.to_json()))
    if read_state(form, plots) != machine.state:
        raise AssertionError("the machine's state is another one after JSON")


def read_tree(data: bytes, folder: Path) -> None:
    """A file of behaviour trees: read, written, read again."""
    trees = load_trees(_written(data, folder, "tree.xml"))
    if parse_trees(trees_to_xml(trees)) != trees:
        raise AssertionError("read again, it is another file of trees")


def read_controller(data: bytes, folder: Path) -> None:
    """A plot whose controllers are built; the Python one is executed for a few events."""
    plot = load_plot(_written(data, folder, "plot.yaml"))
    if validate_plot(plot, Library([plot])) or any(one.required for one in plot.parameters.values()):
        return
    texts = {target: build_controller(plot, target) for target in ("c99", "python")}
    names: dict[str, Any] = {}
    exec(compile(texts["python"], "controller.py", "exec"), names)  # noqa: S102  the text is what is tested
    controller = names["Controller"]()
    controller.init(names["Host"](), now_ns=0)
    for number, event in enumerate([*names["Events"]][:6]):
        controller.post(event)
        controller.step(now_ns=(number + 1) * 10**9)


def read_edited(data: bytes, folder: Path) -> None:
    """A plot's text after edits, each of which is undone."""
    text = _text(data).replace("\r", "")
    plot = parse_plot(text)
    for _, _, path in [*plot.walk()][:4]:
        edits = RenameState(path, "other"), Remove(path), Add((*path, "about"), "a note"), Move(path, (*path[:-1], "z"))
        for edit in edits:
            _unless(InputError, partial(_undo, text, edit))


def _undo(text: str, edit: Edit) -> None:
    after = apply(text, edit)
    if patch(after, differences(after, text)) != text:
        raise AssertionError(f"{edit} is not undone")


def read_deployment(data: bytes, folder: Path) -> None:
    """A deployment model; one without mistakes is drawn, and its tasks meet their deadlines in the worst case."""
    deployment = load_deployment(_written(data, folder, "deployment.yaml"))
    if check_deployment(deployment):
        return
    for core in cores_of(deployment):
        if core.worst_schedule().misses:
            raise AssertionError(f"a deadline is missed on {core}")
    draw_deployment(deployment, {})
    draw_worst_cases(deployment)


def read_monitoring(data: bytes, folder: Path) -> None:
    """A monitoring profile."""
    load_monitoring(_written(data, folder, "monitor.yaml"))


def read_profile(data: bytes, folder: Path) -> None:
    """A profile of a robot."""
    profile = load_profile(_written(data, folder, "profile.yaml"))
    if parse_profile(profile_to_yaml(profile)).digest != profile.digest:
        raise AssertionError("read again, it is another profile")


def read_scenario(data: bytes, folder: Path) -> None:
    """A scenario: what stands on the table, up to the robot's knowledge of it."""
    scenario = Scenario.load(_written(data, folder, "scenario.yaml"))
    with deploy(scenario) as table:
        table.knowledge.to_json()


def read_machine(data: bytes, folder: Path) -> None:
    """The state of a machine as JSON."""
    try:
        form = json.loads(data)
    except (ValueError, RecursionError):
        return
    read_state(form, LIBRARY)


# -- PDDL and the language -------------------------------------------------------------------------------


def read_domain(data: bytes, folder: Path) -> None:
    """A planning domain: read, written, read again; a problem of it is posed."""
    file = _written(data, folder, "domain.pddl")
    read = PlanningDomain.from_pddl(file)
    PlanningDomain.parse(read.to_pddl())
    list(read.notes)
    kb = KnowledgeBase(Schema.from_pddl(file))
    build_problem(read, kb, parse_condition("(and)"), patience=WorkLimit(PATIENCE_S))


def read_fragment(data: bytes, folder: Path) -> None:
    """A part of a domain, merged with one that is there."""
    merged = PlanningDomain.from_fragments([DOMAIN, _written(data, folder, "fragment.pddl")])
    merged.to_pddl()


def read_problem_file(data: bytes, folder: Path) -> None:
    """A problem of the kitchen: read, told to a knowledge base, written, posed."""
    planning = _kitchen_planning()
    problem = read_problem(_written(data, folder, "problem.pddl"), planning.schema, domain="kitchen")
    kb = KnowledgeBase(planning.schema)
    kb.apply(problem.delta(), author="fuzz")
    again = KnowledgeBase(planning.schema)
    again.apply(read_problem(kb.to_pddl("kitchen", "again"), planning.schema).delta(), author="fuzz")
    if _known(again) != _known(kb):
        raise AssertionError("read again, it is another problem")
    build_problem(planning, kb, problem.goal, problem.metric, patience=WorkLimit(PATIENCE_S))


def read_condition(data: bytes, folder: Path) -> None:
    """A condition: checked, printed, asked, explained, installed."""
    text = _text(data)
    expression = parse_condition(text, "EXPR")
    check(expression, _kitchen().schema)
    if parse_condition(to_text(expression)) != expression:
        raise AssertionError(f"printed, it is another condition: {to_text(expression)}")
    kb = _kitchen()
    answers = kb.query(expression)
    kb.explain(expression, answers[0] if answers else {})
    installed = kb.install(expression)
    installed.cancel()


def read_effect(data: bytes, folder: Path) -> None:
    """An effect, and what is told and taken back."""
    text = _text(data)
    kb = _kitchen()
    for meaning in (told, retracted):
        _unless(InputError, partial(meaning, [text], kb, "FACT"))
    effect = parse_effect(text, "EFFECT")
    check_effect(effect, kb.schema)
    to_text(effect)


def read_term(data: bytes, folder: Path) -> None:
    """A term."""
    term = parse_term(_text(data), "TERM")
    if parse_term(to_text(term)) != term:
        raise AssertionError(f"printed, it is another term: {to_text(term)}")


# -- what programs wrote ---------------------------------------------------------------------------------


def read_world(data: bytes, folder: Path) -> None:
    """A knowledge base as JSON."""
    with KnowledgeBase.from_json(_written(data, folder, "world.json")) as kb:
        text = kb.to_json()
        with KnowledgeBase.from_json(text) as again:
            if again.to_json() != text:
                raise AssertionError("written again, it is another world")
        _unless(InputError, lambda: kb.to_pddl("world", "problem"))


def read_trace_file(data: bytes, folder: Path) -> None:
    """A trace, and what the page asks about it."""
    log = read_trace(_written(data, folder, "trace.jsonl"))
    log.batch(1)
    answers = PageQueries(log)
    for seq in {0, 1, 2, len(log) // 2, len(log), len(log) + 1}:
        _unless(InputError, partial(answers.facts, {"seq": seq}))
        _unless(InputError, partial(answers.query, {"seq": seq, "expression": "(on ?x ?y)"}))


def read_store(data: bytes, folder: Path, name: str) -> None:
    """A store with one byte string, or one row, that nobody wrote."""
    original = stores()[name]
    file = folder / "store.db"
    if data.startswith(b"rows "):
        file.write_bytes(original)
        random = Random(data.decode("latin-1"))
        for _ in range(random.choice((1, 1, 2, 4))):
            reset(file, random)
    else:
        file.write_bytes(data)
    uses: list[Callable[[], Any]] = [partial(_read_knowledge, file), partial(_read_viewed, file)]
    if name == "run":
        uses += [partial(_read_runs, file), lambda: replay(file)]
    uses.append(partial(_write_knowledge, file))
    for use in uses:
        _unless(InputError, use)


def _read_knowledge(file: Path) -> None:
    with KnowledgeBase.open(None, file, read_only=True) as kb:
        kb.to_json()
        kb.changes(kb.oldest)
        kb.at(version=kb.oldest)


def _write_knowledge(file: Path) -> None:
    with KnowledgeBase.open(None, file) as kb:
        kb.apply(next(iter(kb.changes(kb.oldest))).delta if kb.changes(kb.oldest) else kb.changes().pop().delta, "fuzz")


def _read_viewed(file: Path) -> None:
    with records_of(file) as log:
        PageQueries(log).facts({"seq": len(log)})


def _read_runs(file: Path) -> None:
    with archive(file) as runs:
        for run in runs.runs():
            for step in runs.steps(run.number):
                list(step.records)
            list(runs.records(run.number))
        runs.running_actions()


# -- what comes over a wire ------------------------------------------------------------------------------


class Moved(Outcome):
    to: object


class _Arm(Component):
    """Has a skill."""

    name = "arm"

    @skill
    async def move(self, call: SkillCall, to: str) -> Moved:
        """Be there at once."""
        return Moved(to=to)


def read_frames(data: bytes, folder: Path) -> None:
    """Frames, one a line, sent to a component that another program uses."""
    wrong: list[BaseException] = []

    async def main() -> None:
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(lambda _, said: wrong.append(said.get("exception") or RuntimeError(said["message"])))
        transport = LocalTransport()
        host = Host(_Arm(), transport, LoopClock())
        transport.attach("fuzz", lambda sender, frame: json.loads(frame))
        for frame in data.split(b"\n")[:50]:
            transport.deliver("fuzz", "arm", frame)
            await asyncio.sleep(0)
        await asyncio.sleep(1)
        await host.close()

    run_simulated(main())
    if wrong:
        raise wrong[0]


def read_request(data: bytes, folder: Path) -> None:
    """One request of the page, or the frames of its socket, to a run that may be controlled."""
    try:
        asked = json.loads(data)
    except (ValueError, RecursionError):
        asked = {"path": "/query", "method": "POST", "body": data.decode("latin-1")}
    if not isinstance(asked, dict):
        asked = {"path": "/control", "method": "POST", "body": json.dumps(asked)}
    asyncio.run(_asked(asked))


async def _asked(asked: dict[str, Any]) -> None:
    log = RecordLog(header(run="fuzz"), live=True)
    control = Control(lambda: None)
    entrance = _entrance()
    viewer = Viewer(log, entrance, control)
    app = viewer.application()
    clock = LoopClock()
    knowledge = KnowledgeBase(_kitchen().schema)
    sequencer = Sequencer(Library([_waiting()]), knowledge, [], clock, Trace(clock.now), open_ended=True)
    sequencer.trace.listen(log.receive)
    control.attach(sequencer)
    running = asyncio.create_task(sequencer.run("waiting"))
    try:
        await asyncio.sleep(0)
        opened = await _http(app, {"path": "/", "query": viewer.url.partition("?")[2]}, [])
        cookies = [value.split(b";")[0] for name, value in opened["headers"] if name.lower() == b"set-cookie"]
        said = await _http(app, asked, [(b"cookie", b"; ".join(cookies))] if cookies else [])
        if said["status"] >= 500:
            raise AssertionError(f"answered with {said['status']}")
    finally:
        running.cancel()
        await asyncio.wait([running])
        if running.done() and not running.cancelled() and (failed := running.exception()) is not None:
            raise failed


async def _http(app: Any, asked: dict[str, Any], headers: list[tuple[bytes, bytes]]) -> dict[str, Any]:
    """Have the application answer, without a socket."""
    entrance = _entrance()
    host = f"127.0.0.1:{entrance.port}".encode()
    frames = asked.get("socket")
    given = [(_raw(n), _raw(v)) for n, v in _pairs(asked.get("headers"))]
    body = asked.get("body", "")
    sent = iter([_raw(body if isinstance(body, str) else json.dumps(body))])
    said: dict[str, Any] = {"status": 200, "headers": []}
    scope = {
        "type": "http" if frames is None else "websocket",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": str(asked.get("method", "GET")).upper(),
        "path": str(asked.get("path", "/")),
        "raw_path": _raw(str(asked.get("path", "/"))),
        "root_path": "",
        "scheme": "http" if frames is None else "ws",
        "query_string": _raw(str(asked.get("query", ""))),
        "headers": [(b"host", host), (b"origin", b"http://" + host), *headers, *given],
        "client": ("127.0.0.1", 1),
        "server": ("127.0.0.1", entrance.port),
        "subprotocols": [],
    }
    texts = iter(frames if isinstance(frames, list) else ())
    begun = False

    async def receive() -> dict[str, Any]:
        nonlocal begun
        if frames is None:
            part = next(sent, None)
            return {"type": "http.disconnect"} if part is None else {"type": "http.request", "body": part}
        if not begun:
            begun = True
            return {"type": "websocket.connect"}
        await asyncio.sleep(0)
        one = next(texts, None)
        if one is None:
            return {"type": "websocket.disconnect", "code": 1000}
        return {"type": "websocket.receive", **({"bytes": b"\xff"} if one is False else {"text": str(one)})}

    async def send(message: dict[str, Any]) -> None:
        if message["type"] == "http.response.start":
            said.update(status=message["status"], headers=list(message["headers"]))

    await app(scope, receive, send)
    return said


def _pairs(headers: Any) -> Iterable[tuple[Any, Any]]:
    return headers.items() if isinstance(headers, dict) else ()


def _raw(text: Any) -> bytes:
    return str(text).encode("utf-8", "surrogatepass")


# -- what readers share ----------------------------------------------------------------------------------


def _unless(errors: type[Exception], use: Callable[[], Any]) -> None:
    """Use it; those errors are answers."""
    try:
        use()
    except errors as error:
        str(error)


def _text(data: bytes) -> str:
    return (
        data.decode("utf-8", "surrogatepass" if b"\xed" in data else "replace")
        if _decodes(data)
        else data.decode("latin-1")
    )


def _decodes(data: bytes) -> bool:
    try:
        data.decode("utf-8", "surrogatepass")
    except UnicodeDecodeError:
        return False
    return True


def _known(kb: KnowledgeBase) -> tuple[Any, ...]:
    return kb.nodes(), set(kb.facts()), kb.values()


@cache
def _kitchen() -> KnowledgeBase:
    schema = Schema.from_pddl(KITCHEN / "domain.pddl")
    kb = KnowledgeBase(schema)
    kb.apply(read_problem(KITCHEN / "problem.pddl", schema).delta(), author="fuzz")
    return kb


@cache
def _kitchen_planning() -> PlanningDomain:
    action = "(define (domain kitchen) (:action wipe :parameters (?t - thing) :effect (clean ?t)))"
    return PlanningDomain.from_fragments([KITCHEN / "domain.pddl", action])


@cache
def _table() -> KnowledgeBase:
    return deploy(Scenario.default()).knowledge


@cache
def _waiting() -> ActionPlot:
    return parse_plot(
        "plot: waiting\nreceives: {go: , stop: }\nstates:\n  a: {on: {go: a, stop: b}}\n  b: {final: true}\n"
    )


@cache
def _entrance() -> PageAddress:
    return PageAddress.on()


@cache
def stores() -> dict[str, bytes]:
    """A knowledge store and a run store, the same bytes in every process but for times."""
    import tempfile

    made = {}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "kitchen.db"
        with KnowledgeBase.open(_kitchen().schema, file) as kb:
            kb.apply(read_problem(KITCHEN / "problem.pddl", kb.schema).delta(), author="fuzz")
            for name in ("mug", "muesli"):
                kb.apply(told([f"(not (on {name} table))"], kb), "fuzz")
        made["knowledge"] = file.read_bytes()
        file = Path(folder) / "run.db"
        with deploy(Scenario.parse("table: {cups: 1}"), store=file) as table:
            table.report()
        made["run"] = file.read_bytes()
    return made


class StoreTarget(Target):
    """A store: bytes are changed, or rows."""

    def seeds(self) -> tuple[bytes, ...]:
        """The store itself; what was found by rows is kept as `rows NUMBER`."""
        return (stores()[self.name.removesuffix("-store")], *_seeds(self))

    def vary(self, random: Random) -> bytes:
        """Rows in half of the inputs."""
        if random.random() < 0.6:
            return b"rows %d" % random.randrange(2**32)
        seed = self.seeds()[0]
        return mutated(seed, random, (seed,), (), "database")


READERS = (
    Target(
        "plot",
        read_plot,
        ("domains/*/plots/*.yaml", "planning/plots/*.yaml", "tests/support/broken/yaml/*.yaml"),
        share=6,
    ),
    Target("chart", read_chart, ("tests/support/broken/scxml/*.scxml",), share=6),
    Target("tree", read_tree, ("domains/*/trees/*.xml", "tests/dsc/trees/*.xml"), share=4),
    Target("controller", read_controller, ("examples/controllers/*.yaml",), share=4),
    Target("edited", read_edited, ("domains/*/plots/*.yaml",), share=4),
    Target("profile", read_profile, ("domains/*/profiles/*.yaml",), share=3),
    Target("deployment", read_deployment, ("examples/strangers/lab.yaml",), share=3),
    Target("monitoring", read_monitoring, ("examples/strangers/monitor.yaml",), share=1),
    Target("scenario", read_scenario, (), share=2),
    Target("state", read_machine, (), "json", share=3),
    Target(
        "domain", read_domain, ("domains/*/domain.pddl", "examples/*.pddl", "tests/support/broken/domain.pddl"), share=5
    ),
    Target("fragment", read_fragment, ("examples/kitchen/domain.pddl",), share=2),
    Target("problem", read_problem_file, ("examples/kitchen/problem.pddl",), share=5),
    Target("condition", read_condition, (), share=6),
    Target("effect", read_effect, (), share=5),
    Target("term", read_term, (), share=2),
    Target("world", read_world, (), "json", share=4),
    Target("trace", read_trace_file, (), "lines", share=4),
    Target("frames", read_frames, (), "lines", share=4),
    Target("request", read_request, (), "json", share=4),
    StoreTarget("knowledge-store", partial(read_store, name="knowledge"), form="database", share=1),
    StoreTarget("run-store", partial(read_store, name="run"), form="database", share=1),
)
FINE = (InputError, RunawayError, WorkLimitError)
"""How a reader may end besides returning."""
