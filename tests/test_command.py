"""The command as people use it: reports, exit status, and one clear line for what they got wrong."""

import inspect
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import get_type_hints

import pytest
from typer.main import get_command

from knowledge_base import Delta, KnowledgeBase, Schema
from knowledge_base.errors import InputError
from planning.cli.command import app, main
from planning.robot.robot import Robot

TABLE = Path(__file__).parent.parent / "domains" / "clean_up_table"


@pytest.fixture
def dsc(monkeypatch, capsys):
    def call(*words):
        monkeypatch.setattr(sys, "argv", ["dsc", *map(str, words)])
        with pytest.raises(SystemExit) as stopped:
            main()
        shown = capsys.readouterr()
        return stopped.value.code or 0, shown.out, shown.err

    return call


def test_a_run_reports_as_json(dsc):
    status, out, err = dsc("run", "clean-up-table", "--seed", 4, "--faults", 0.1, "--json")
    report = json.loads(out)
    assert (status, err) == (0, "")
    assert report["goal_reached"] is True
    assert (report["robot"], report["judge"]) == ("clean-up-table", "world")
    assert {"left", "plans", "replans", "skill_failures", "recoveries", "candidates_chosen", "simulated_s",
            "wall_s", "faults", "problem"} <= set(report)  # fmt: skip
    assert set(report["clean-up-table"]) == {"items", "left", "trips", "faults", "touched"}


def test_a_run_ends_at_its_limit_and_the_report_names_it(dsc):
    status, out, _ = dsc("run", "clean-up-table", "--until", 20, "--json")
    report = json.loads(out)
    assert (status, report["goal_reached"]) == (1, False)
    assert report["problem"] == "the run has not ended within 20 s of run time (until)"
    assert {left["reason"] for left in report["left"]} == {report["problem"]}


def test_a_run_in_a_pipe_tells_its_progress_in_plain_lines(dsc):
    status, out, _ = dsc("run", "clean-up-table")
    assert status == 0
    assert "step   1  (pick-up" in out
    assert "The table is clear: 9 of 9 items away in 3 trips" in out
    assert "\x1b" not in out


def test_something_left_is_exit_status_1_and_is_named(dsc):
    status, out, _ = dsc("run", "clean-up-table", "--seed", 6, "--faults", 0.2, "--json")
    report = json.loads(out)
    assert (status, report["goal_reached"]) == (1, False)
    own = report["clean-up-table"]
    assert sorted(one["item"] for one in own["left"]) == own["touched"] != []
    assert [one["what"] for one in report["left"]] == [one["item"] for one in own["left"]]
    assert all(one["reason"] and one["where"] for one in report["left"])


def test_a_trace_is_written_while_the_run_goes_on(dsc, tmp_path):
    file = tmp_path / "run.jsonl"
    dsc("run", "clean-up-table", "--trace", file, "--json")
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    assert lines[0]["format"] == "dsc-trace"
    assert lines[-1]["type"] == "end"


def test_a_scenario_of_ones_own(dsc, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("table:\n  cups: 2\n  items: {pringles: {kind: crisp_can, size: small}, coke: can}\n")
    _, out, _ = dsc("run", "clean-up-table", "--scenario", file, "--json")
    report = json.loads(out)
    own = report["clean-up-table"]
    assert (own["items"], own["trips"], report["goal_reached"]) == (4, 2, True)


PLOT = """plot: wrong
states:
  look:
    use: {use}
    with: {{surface: table}}
    on: {{recognised: {target}, nothing_found: ended, {third}}}
  ended: {{final: true}}
"""


def test_nothing_people_get_wrong_gives_a_traceback(dsc, tmp_path):
    def file(name, text):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    recognise = (TABLE / "plots" / "recognise.yaml").read_text()
    file("recognise.yaml", recognise)
    good = {"use": "recognise", "target": "ended", "third": "not_possible: ended"}
    problem = (
        "(define (problem p) (:domain clean-up-table)\n (:objects red - {kind})\n (:init {fact})\n (:goal (tidy red)))"
    )
    cases = [
        (["run", "clean-up-tabel"], "clean-up-table"),
        (["run", "clean-up-table", "--scenario", tmp_path / "none.yaml"], "there is no file"),
        (["run", "clean-up-table", "--scenario", file("a.yaml", "table:\n  cupz: 4\n")], "a.yaml:2:3: unknown key 'cupz'; did you mean 'cups'?"),
        (["run", "clean-up-table", "--scenario", file("b.yaml", "table: {items: {x: mug}}\n")], "b.yaml:1"),
        (["run", "clean-up-table", "--trace", tmp_path / "no" / "where.jsonl"], "--trace: cannot write"),
        (["plot", "check", file("c.yaml", PLOT.format(**{**good, "use": "recognize"}))], "did you mean 'recognise'?"),
        (["plot", "check", file("d.yaml", PLOT.format(**{**good, "target": "endet"}))], "d.yaml:6"),
        (["plot", "check", file("e.yaml", PLOT.format(**{**good, "third": "recognizd: ended"}))], "does not handle its outcome 'not_possible'"),
        (["plot", "show", file("f.yaml", "plot: f\nstats: {}\n")], "f.yaml:2:1: unknown key 'stats'; did you mean 'states'?"),
        (["plan", TABLE / "domain.pddl", file("g.pddl", problem.format(kind="cupp", fact=""))], "did you mean 'cup'?"),
        (["plan", TABLE / "domain.pddl", file("h.pddl", problem.format(kind="cup", fact="(graspabel red)"))], "h.pddl:3"),
        (["kb", "query", file("i.pddl", problem.format(kind="cup", fact="")), "(and (cup ?x) (seeen ?x))", "--domain", TABLE / "domain.pddl"], "did you mean 'seen'?"),
    ]  # fmt: skip
    for words, said in cases:
        status, out, err = dsc(*words)
        assert status == 2, (words, out, err)
        assert said in out + err, (words, out, err)
        assert "Traceback" not in out + err


def test_bad_input_is_told_to_programs_as_json(dsc, tmp_path):
    problem = tmp_path / "p.pddl"
    problem.write_text("(define (problem p) (:domain clean-up-table)\n (:objects red - cupp) (:goal (tidy red)))")
    wrong = {"outcome": "bad_input", "message": "there is no type 'cupp'", "file": str(problem), "line": 2, "column": 12,
             "found": "cupp", "nearest": "cup"}  # fmt: skip
    for words in (["plan", TABLE / "domain.pddl", problem], ["kb", "show", problem, "--domain", TABLE / "domain.pddl"]):
        status, out, err = dsc(*words, "--json")
        assert (status, json.loads(out), err) == (2, wrong, "")
    status, out, err = dsc("run", "clean-up-tabel", "--json")
    assert (status, json.loads(out)["file"], json.loads(out)["nearest"], err) == (2, None, "clean-up-table", "")


@pytest.mark.parametrize(
    ("words", "message", "nearest"),
    [
        (["run", "clean-up-table", "--sed", "3"], "no such option: --sed", "--seed"),
        (
            ["run", "clean-up-table", "--faults", "2"],
            "Invalid value for '--faults': Input should be less than or equal to 1",
            None,
        ),
        (["run", "clean-up-table", "--durability", "fo"], "is not one of 'process', 'power'", None),
        (["plan"], "Missing argument 'DOMAIN... PROBLEM'", None),
        (["fly"], "No such command 'fly'", None),
        (["kb", "fly"], "No such command 'fly'", None),
        (["runs", "list"], "Missing argument 'FILE'", None),
        (["run", "clean-up-table", "--store", "."], "is a folder, not a regular file", None),
    ],
)
def test_an_invalid_command_line_is_reported_as_json(dsc, words, message, nearest):
    status, out, err = dsc(*words, "--json")
    said = json.loads(out)
    assert (status, err, said["outcome"], said["nearest"]) == (2, "", "bad_input", nearest)
    assert message in said["message"]


def test_with_json_the_exit_status_is_the_commands_own(dsc):
    assert dsc("doctor", "--json")[0] == 0
    assert dsc("plot", "check", "none.yaml", "--json")[0] == 2


def installed(words, out):
    """The installed command with its output going there: its exit status and what it complains about."""
    command: list[str | Path] = [Path(sys.executable).with_name("dsc"), *map(str, words)]
    done = subprocess.run(command, stdout=out, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    return done.returncode, done.stderr


def test_a_closed_standard_error_does_not_prevent_a_plan(tmp_path):
    domain, problem = tmp_path / "d.pddl", tmp_path / "p.pddl"
    domain.write_text("(define (domain d) (:predicates (p)) (:action a :parameters () :effect (p)))")
    problem.write_text("(define (problem q) (:domain d) (:init) (:goal (p)))")
    command = [str(Path(sys.executable).with_name("dsc")), "plan", str(domain), str(problem)]
    done = subprocess.run(["/bin/sh", "-c", '"$@" 2>&-', "sh", *command], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.splitlines()[0].strip()) == (0, "1 (a)")


PRINTING = [["doctor"], ["doctor", "--json"], ["run", "clean-up-table", "--json"], ["plan", "none", "none", "--json"]]


@pytest.mark.parametrize("words", PRINTING, ids=" ".join)
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a full device")
def test_an_output_error_prints_one_line_and_sets_the_exit_status(words):
    with Path("/dev/full").open("w") as full:
        assert installed(words, full) == (74, "dsc: cannot write: No space left on device\n")


@pytest.mark.parametrize("words", PRINTING[1:], ids=" ".join)
def test_a_closed_pipe_sets_the_exit_status_without_a_message(words):
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as pipe:
        assert installed(words, pipe) == (141, "")


def test_usage_errors_are_exit_status_2(dsc):
    assert dsc("run")[0] == 2
    assert dsc("run", "clean-up-table", "--faults", "2")[0] == 2
    assert dsc("fly")[0] == 2


def test_the_installed_command_answers():
    done = subprocess.run(
        [Path(sys.executable).with_name("dsc"), "--help"], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0
    assert "Dynamic State Charts" in done.stdout


# --- files that commands write

PLOTS = TABLE / "plots"


def outputs(folder):
    """Each option that names a file to be written, with a command that would write it."""
    problem = folder / "problem.pddl"
    (folder / "domain.pddl").write_text((TABLE / "domain.pddl").read_text())
    problem.write_text(
        "(define (problem p) (:domain clean-up-table) (:objects red - cup) (:init) (:goal (not (tidy red))))"
    )
    chart = folder / "chart.scxml"
    chart.write_text('<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0"><final id="end"/></scxml>')
    shutil.copytree(PLOTS, folder, dirs_exist_ok=True)
    plot = folder / "report.yaml"
    return {
        "--trace": ["run", "clean-up-table", "--json"],
        "--plot": ["plan", folder / "domain.pddl", problem],
        "--svg": ["plot", "show", plot],
        "plot diff --svg": ["plot", "diff", plot, PLOTS / "search.yaml"],
        "plot import --out": ["plot", "import", chart],
        "plot export --out": ["plot", "export", plot, "--to", "svg"],
        "kb export --to": ["kb", "export", problem],
        "kb draw --to": ["kb", "draw", problem],
    }


@pytest.fixture
def store(tmp_path):
    path = tmp_path / "kept.db"
    with KnowledgeBase.open(Schema.from_pddl(TABLE / "domain.pddl"), path) as kb:
        kb.apply(Delta(nodes={"red": "cup"}), "test")
    return path


def test_no_option_writes_over_a_store_or_what_belongs_to_it(dsc, tmp_path, store):
    (tmp_path / "hard.svg").hardlink_to(store)
    before = store.read_bytes()
    for option, words in outputs(tmp_path).items():
        for path in (tmp_path / "hard.svg", f"{store}-wal"):
            status, out, err = dsc(*words, option.split()[-1], path)
            assert (status, "store" in out + err) == (2, True), (option, path, out, err)
    assert store.read_bytes() == before
    assert not any(Path(f"{store}{end}").exists() for end in ("-wal", "-lock"))


def test_no_option_writes_over_what_the_command_reads(dsc, tmp_path):
    for option, words in outputs(tmp_path).items():
        files = [word for word in words if isinstance(word, Path) and word.parent == tmp_path]
        files += [tmp_path / "domain.pddl"] if words[0] == "kb" else []
        files += [tmp_path / "drive_planned.yaml"] if "svg" in f"{option} {words}" and "diff" not in words else []
        for file in files:
            before = file.read_bytes()
            (link := tmp_path / "link").symlink_to(file)
            status, out, err = dsc(*words, option.split()[-1], link)
            assert (status, "for something else" in out + err) == (2, True), (option, file, out, err)
            link.unlink()
            assert file.read_bytes() == before


def test_a_trace_is_no_file_that_the_run_keeps_and_nothing_has_run_then(dsc, tmp_path):
    kept = tmp_path / "run.db"
    (tmp_path / "link.db").symlink_to(kept)
    for trace in (kept, f"{kept}-world", f"{kept}-world-wal", tmp_path / "link.db"):
        status, _, err = dsc("run", "clean-up-table", "--store", kept, "--trace", trace)
        assert (status, "--trace: cannot write" in err) == (2, True)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["link.db"]
    (tmp_path / "notes.txt").write_text("my notes")
    assert dsc("run", "clean-up-table", "--store", kept, "--trace", tmp_path / "notes.txt")[0] == 2
    assert (tmp_path / "notes.txt").read_text() == "my notes"
    assert not kept.exists()


def test_a_trace_can_go_to_standard_output_and_over_an_older_trace(dsc, tmp_path):
    status, out, _ = dsc("run", "clean-up-table", "--json", "--trace", "-")
    *records, report = map(json.loads, out.splitlines())
    assert (status, records[0]["format"], records[-1]["type"]) == (0, "dsc-trace", "end")
    assert report["goal_reached"] is True
    file = tmp_path / "run.jsonl"
    file.write_text(out)
    dsc("run", "clean-up-table", "--json", "--trace", file)
    assert [json.loads(line) for line in file.read_text().splitlines()] == records


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a full device")
def test_an_output_on_a_full_medium_is_named(dsc, tmp_path):
    for option, words in outputs(tmp_path).items():
        status, out, err = dsc(*words, option.split()[-1], "/dev/full")
        named = "" if option == "--trace" else " '/dev/full'"
        assert (status, err) == (74, f"dsc: cannot write{named}: No space left on device\n"), out


# --- every command with every kind of file that it is not meant for


TELLING = {"folder", "fifo", "loop"}
"""The kinds that most often went wrong; `make sweep-files` takes all."""


def bad_files(folder, store):
    """Files of every kind, none of which is what a command wants; a store and a plot are wrong for most."""
    folder.mkdir()
    (folder / "folder").mkdir()
    (folder / "empty").touch()
    (folder / "binary").write_bytes(bytes(range(256)) * 8)
    (folder / "half.json").write_text('{"format": "dsc-knowledge/2"')
    (folder / "open.pddl").write_text("(define (domain d")
    (folder / "plot.yaml").write_text("plot: p\nstates:\n  a: {on: {go: nowhere}}\n")
    (folder / "loop").symlink_to("loop")
    os.mkfifo(folder / "fifo")
    shutil.copy(store, folder / "store.yaml")
    made = [*sorted(folder.iterdir()), folder / "missing", folder / "empty" / "inside", folder / ("x" * 300)]
    return made if "SWEEP" in os.environ else [one for one in made if one.name in TELLING or len(one.name) == 300]


def leaves(group, words=()):
    """The commands below a group, each with the words that call it."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from leaves(command, (*words, name))
        else:
            yield (*words, name), command


def takes_a_file(command, parameter):
    hint = get_type_hints(inspect.unwrap(command.callback)).get(parameter.name)
    return "Path" in str(hint) or any(said in (parameter.metavar or "") for said in ("FILE", "OUT", "TARGET"))


GOOD = {
    "plot.yaml": "plot: p\nstates:\n  a: {on: {go: b}}\n  b: {final: true}\n",
    "domain.pddl": "(define (domain d) (:types cup))",
    "problem.pddl": "(define (problem p) (:domain d) (:objects x - cup) (:goal (cup x)))",
}
PLAIN = {
    "plot": "plot.yaml", "kb": "problem.pddl", "plan": "domain.pddl", "domain": "domain.pddl", "world": "clean-up-table",
    "prefix": "x_", "to": "svg", "expression": "(cup x)", "facts": "(cup x)", "when": "0",
}  # fmt: skip
"""A word for each parameter that is not swept, by its name or else by the command's first word."""
ENDING = {("view",): ["--no-open"], ("kb", "watch"): ["--seconds", "0"]}
"""Options with which commands end that would go on."""
SWEPT = [
    pytest.param(words, command.params, swept, id=" ".join([*words, swept.name]))
    for words, command in leaves(get_command(app))
    for swept in command.params
    if takes_a_file(command, swept)
]


def words_with(words, params, swept, path):
    """The command with that file, and with something plain wherever else a word is needed."""
    options, arguments = [*ENDING.get(words, ())], []
    for one in params:
        if not (one.required or one is swept or one.name == "world"):
            continue
        word = path if one is swept else PLAIN.get(one.name, PLAIN.get(words[0], "x"))
        if one.param_type_name == "argument":
            arguments += [word] * (2 if words == ("plan",) else 1)
        else:
            options += [one.opts[0], word]
    return [*words, *options, *arguments]


def content(path):
    try:
        return path.read_bytes() if path.is_file() else None
    except OSError:  # a name that no file has
        return None


def would_run(*_, **__):
    raise InputError("it would run")


def test_the_sweep_has_every_command_that_takes_a_file():
    swept = {words for words, *_ in (one.values for one in SWEPT)}
    assert {words for words, _ in leaves(get_command(app))} - swept == {
        ("doctor",),
        ("bundles",),
        ("lsp",),
        ("plot", "schema"),
    }


@pytest.mark.parametrize(("words", "params", "swept"), SWEPT)
def test_no_kind_of_file_gives_a_traceback_or_a_wait(dsc, tmp_path, store, monkeypatch, words, params, swept):
    for name, text in GOOD.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("knowledge_base.pddl.files.WRITER_S", 0.0)
    monkeypatch.setattr("knowledge_base.output_files.PATIENCE_S", 0.0)
    monkeypatch.setattr("dsc.cli.view.until_interrupt", lambda _: None)
    monkeypatch.setattr(Robot, "report", would_run)
    for path in bad_files(tmp_path / "bad", store):
        before = content(path)
        status, out, err = dsc(*words_with(words, params, swept, path))
        assert status in {0, 1, 2}, (path, out, err)
        assert "Traceback" not in out + err
        if status == 2:
            assert 0 < len((out + err).splitlines()) <= 6, (path, out, err)
            assert content(path) == before or words == ("run",)  # it would have written there
