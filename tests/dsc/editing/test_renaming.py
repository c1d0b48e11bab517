"""Renames of any name in the shipped plots and the tutorial's project: the renamed model, few lines, and back."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from dsc.dynamic.library import Library
from dsc.editing.name_index import NameIndex
from dsc.editing.renaming import KINDS, rename_named
from dsc.editing.workspace import Workspace
from dsc.events import RESERVED
from dsc.text.plot_files import parse_plot
from dsc.validation import validate_plot
from knowledge_base.errors import InputError
from knowledge_base.pddl.unsaved_texts import readable_text
from knowledge_base.world.schema import Schema

ROOT = Path(__file__).parents[3]
FOLDERS = [
    *sorted(one.parent for one in (ROOT / "domains").glob("*/plots")),
    ROOT / "planning/project_template", ROOT / "planning/plots", ROOT / "tests/support/lasting_robot",
]  # fmt: skip
WORDS = {kind: word for word, kind in KINDS.items()}


def pages(folder, texts=None):
    return Workspace().pages(folder, texts or {})


@cache
def names(folder):
    """Return the kind and full name of each definition in a folder."""
    index = NameIndex(pages(folder))
    found = {
        (WORDS[kind], f"{one.scope.rpartition(' ')[2]}.{one.name}" if one.scope else one.name)
        for kind in {*KINDS.values()}
        for one in index.definitions(kind)
        if kind != "event" or one.name not in RESERVED
    }
    return sorted(found)


def models(folder, texts=None):
    """Return the models of a folder's plots as JSON, and their findings with the domains next to them."""
    found = {page.file: page for page in pages(folder, texts)}
    plots = {file: parse_plot(page.text, str(file)) for file, page in found.items() if page.plot}
    library, schemas = Library(plots.values()), dict[Path, Schema]()
    for file, page in found.items():
        if file.name == "domain.pddl":
            schemas[file.parent / "plots"] = Schema.parse(page.text, str(file))
    findings = [
        str(one) for file, plot in plots.items() for one in validate_plot(plot, library, schemas.get(file.parent))
    ]
    return [json.dumps(plot.model_dump(mode="json", by_alias=True)) for plot in plots.values()], findings


@cache
def models_before(folder):
    return models(folder)


def with_name(text, new, old):
    """Return a text with a word in place of another one; the new name is part of no other word."""
    return re.sub(rf"{new}\b", lambda _: old, text)


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda one: one.name)
@given(data=st.data())
@settings(max_examples=5, deadline=None, phases=[Phase.generate])
def test_a_rename_in_shipped_texts(folder, data):
    kind, full = data.draw(st.sampled_from(names(folder)))
    old, new = full.rpartition(".")[2], "zyx_9"
    _, texts = rename_named(folder, kind, full, new)
    for file, text in texts.items():
        lines, before = text.splitlines(), readable_text(file).splitlines()
        assert len(lines) == len(before)
        changed = [(one, other) for one, other in zip(before, lines, strict=True) if one != other]
        assert changed
        assert all(with_name(other, new, old).lower() == one.lower() for one, other in changed)
    after, findings = models(folder, texts)
    before, known = models_before(folder)
    assert [with_name(one, new, old).lower() for one in after] == [one.lower() for one in before]
    assert len(findings) == len(known), set(findings) - set(known)
    full_new = f"{full.rpartition('.')[0]}.{new}" if "." in full else new
    _, back = rename_named(folder, kind, full_new, old, texts)
    assert back == {file: readable_text(file) for file in texts}


FILES = {
    "domain.pddl": "(define (domain d) (:types item) (:constants cup - item) (:predicates (held ?i - item))\n"
    " (:action take :parameters (?item - item) :precondition (and) :effect (held ?item)))\n",
    "plots/take.yaml": """\
plot: take
implements: take
parameters: {item: item}
emits: {lost: {what: list of item}}
states:
  go:
    entry: {trigger: arm.grasp, with: {item: ?item}, as: {slipped: fell}}
    on: {grasped: over, fell: {to: gone, emit: lost, with: {what: ?event.what}}}
  over: {final: true}
  gone: {final: true}
""",
    "plots/main.yaml": """\
plot: main
emits: {lost: {}}
receives: {stop: {}}
states:
  first: {dynamic: [take, other], on: {done: second, lost: {to: over, emit: lost}}, with: {item: cup}}
  second:
    entry: {trigger: arm.drop}
    on: {lost: over}
  over: {final: true}
  plan: {goal: (held cup), on: {done: over, no_plan: over, gave_up: over}}
rules:
  - {on: lost, of: [take], do: {pass: {item: cup}, then: retry}}
  - {on: lost, of: [take], do: {use: other, with: {item: cup}, on: {lost: gave_up}}}
handlers:
  - {on: stop, do: {tell: (not (held cup))}}
""",
    "plots/other.yaml": """\
plot: other
parameters: {item: item}
emits: {lost: {}}
states:
  wait: {on: {stop: over}, after: {seconds: 1, to: over, emit: lost}}
  over: {final: true}
""",
    "profiles/slow.yaml": "profile: slow\nplots: {take: {item: cup}}\nchoose: {main: {first: utility}}\n",
    "robot.py": 'use("take")\n\nclass Lost(Outcome):\n    """It."""\n',
}


@pytest.fixture
def project(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def rename_in(project, kind, old, new):
    found, texts = rename_named(project, kind, old, new)
    lines = {
        f"{file.stem}: {line.strip()}"
        for file, text in texts.items()
        for line in text.splitlines()
        if re.search(rf"\b{new}\b", line)
    }
    return lines, [f"{file.name}:{line}" for file, line in found.in_python]


def test_a_candidate_in_its_file_its_uses_and_profiles(project):
    lines, python = rename_in(project, "candidate", "take", "grab")
    assert lines == {
        "take: plot: grab",
        "main: first: {dynamic: [grab, other], on: {done: second, lost: {to: over, emit: lost}}, with: {item: cup}}",
        "slow: plots: {grab: {item: cup}}",
    }
    assert python == ["robot.py:1"]


def test_an_outcome_apart_from_outcomes_of_skills_and_of_the_caller(project):
    lines, python = rename_in(project, "outcome", "take.lost", "gone_away")
    assert lines == {
        "take: emits: {gone_away: {what: list of item}}",
        "take: on: {grasped: over, fell: {to: gone, emit: gone_away, with: {what: ?event.what}}}",
        "main: first: {dynamic: [take, other], on: {done: second, gone_away: {to: over, emit: lost}}, with: {item: cup}}",
        "main: - {on: gone_away, of: [take], do: {pass: {item: cup}, then: retry}}",
        "main: - {on: gone_away, of: [take], do: {use: other, with: {item: cup}, on: {gone_away: gave_up}}}",
        "other: emits: {gone_away: {}}",  # the candidates have one outcome
        "other: wait: {on: {stop: over}, after: {seconds: 1, to: over, emit: gone_away}}",
    }
    assert python == ["robot.py:3"]


def test_an_event_from_outside_and_one_with_a_name_of_the_plot(project):
    lines, _ = rename_in(project, "event", "stop", "halt")
    assert lines == {
        "main: receives: {halt: {}}",
        "main: - {on: halt, do: {tell: (not (held cup))}}",
        "other: wait: {on: {halt: over}, after: {seconds: 1, to: over, emit: lost}}",
    }
    lines, _ = rename_in(project, "event", "take.fell", "dropped")
    assert len(lines) == 2


def test_a_sensor_in_its_plot_and_in_profiles(project):
    (project / "plots" / "drive.yaml").write_text(
        "plot: drive\nrobot:\n  sensors: {dark: number}\nstates: {a: {on: {cycle: {when: (> ?dark 3)}}}}\n"
    )
    (project / "profiles" / "slow.yaml").write_text("profile: slow\ndevices: {drive: {dark: dark}}\n")
    assert rename_in(project, "variable", "drive.dark", "dim")[0] == {
        "drive: sensors: {dim: number}",
        "drive: states: {a: {on: {cycle: {when: (> ?dim 3)}}}}",
        "slow: devices: {drive: {dim: dark}}",
    }


def test_an_activity_where_it_starts_and_stops(project):
    (project / "plots" / "warn.yaml").write_text(
        "plot: warn\nrobot:\n  activities: {blink: {}}\nstates:\n  a: {entry: {start: blink}, exit: [{stop: blink}]}\n"
        "  b: {on: {cycle: {when: (= ?blink true), do: [{stop: blink}]}}}\n"
    )
    assert rename_in(project, "variable", "warn.blink", "flash")[0] == {
        "warn: activities: {flash: {}}",
        "warn: a: {entry: {start: flash}, exit: [{stop: flash}]}",
        "warn: b: {on: {cycle: {when: (= ?flash true), do: [{stop: flash}]}}}",
    }


def test_types_objects_and_actions(project):
    assert "take: emits: {lost: {what: list of thing}}" in rename_in(project, "type", "item", "thing")[0]
    lines, _ = rename_in(project, "object", "cup", "mug")
    assert len(lines) == 7
    assert "slow: plots: {take: {item: mug}}" in lines
    lines, _ = rename_in(project, "action", "take", "grab")
    assert {one.partition(":")[0] for one in lines} == {"domain", "take", "main"}
    lines, _ = rename_in(project, "parameter", "take.item", "thing")
    assert any("pass: {thing: cup}" in one for one in lines)


@pytest.mark.parametrize(
    ("kind", "old", "new", "said"),
    [
        ("plot", "take", "other", "a plot 'other' already"),
        ("plot", "tke", "x", r"defines the plot 'tke'; did you mean 'take'\?"),
        ("plt", "take", "x", r"did you mean 'plot'\?"),
        ("plot", "take", "9x", "'9x' is not a name"),
        ("outcome", "take.lost", "done", "is a reserved"),
        ("predicate", "held", "not", "is a reserved"),
        ("event", "lost", "x", r"several plots define the event 'lost'; write one of main\.lost, other\.lost"),
        ("state", "take.over", "gone", "a state 'gone' already"),
        ("state", "take.over", "null", "would not be read as a name"),
    ],
)
def test_a_refused_rename(project, kind, old, new, said):
    with pytest.raises(InputError, match=said):
        rename_named(project, kind, old, new)


def test_the_command_with_its_reports(project):
    def rename(*words, status=0):
        command = [Path(sys.executable).with_name("dsc"), "plot", "rename", *words, "--project", project]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == status, done.stderr
        return done.stdout

    assert "-plot: take\n+plot: grab\n" in rename("plot", "take", "grab", "--dry-run")
    assert (project / "plots/take.yaml").read_text() == FILES["plots/take.yaml"]
    (project / "plots/other.yaml").write_bytes(FILES["plots/other.yaml"].replace("\n", "\r\n").encode())
    found = json.loads(rename("outcome", "take.lost", "gone_away", "--json"))
    assert [one["line"] for one in found["python"]] == [3]
    assert {Path(one).name for one in found["files"]} == {"main.yaml", "take.yaml", "other.yaml"}
    assert b"emits: {gone_away: {}}\r\n" in (project / "plots/other.yaml").read_bytes()
    rename("plot", "nothing", "x", status=2)
