"""The pages are true: their Python runs, their plots and scenarios are read, their links lead somewhere."""

import ast
import pkgutil
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import house
import pytest

from domains.butler import Scenario as ButlerScenario
from domains.clean_up_table import Scenario
from dsc import load_library, load_plot, parse_plot
from dsc.deployment.model import parse_deployment
from dsc.drawing import draw
from dsc.monitoring.profile import parse_monitoring
from dsc.text.profiles import parse_profile
from knowledge_base.origin import parse_program
from planning.engines.registry import engine

ROOT = Path(__file__).parent.parent
GUIDE = ROOT / "CONTRIBUTING.md"
PAGES = [ROOT / "README.md", GUIDE, *sorted((ROOT / "docs").glob("*.md"))]


def blocks(page, language):
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_python_on_a_page_runs_from_top_to_bottom(page):
    names: dict[str, Any] = {}
    for block in blocks(page, "python"):
        exec(compile(block, str(page), "exec"), names)  # noqa: S102  the page's own code is what is tested


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_yaml_on_a_page_is_a_plot_a_profile_or_a_scenario(page):
    readers: dict[str, Callable[..., object]] = {
        "plot": parse_plot, "profile": parse_profile, "says": ButlerScenario.parse, "deployment": parse_deployment,
        "monitor": parse_monitoring,
    }  # fmt: skip
    for block in blocks(page, "yaml"):
        read = readers.get(block.partition(":")[0], Scenario.parse)
        read(block, str(page))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        assert target.startswith("https://") or (page.parent / target).exists(), target


def named_in_the_guide(form):
    text = re.sub(r"^```.*?^```", "", GUIDE.read_text(), flags=re.MULTILINE | re.DOTALL)
    found = {name for span in re.findall(r"`([^`]+)`", text) for name in re.findall(form, span)}
    assert len(found) > 10
    return found


def test_files_that_the_guide_for_contributors_names_exist():
    for path in named_in_the_guide(r"(?<!\S)[\w.-]+/[\w./-]+(?!\S)|^[\w.-]+\.(?:md|py|toml|yaml)$"):
        assert path.startswith(".venv/") or (ROOT / path).exists(), path


def test_targets_that_the_guide_for_contributors_names_exist():
    targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    assert named_in_the_guide(r"^make ([\w-]+)") - {*targets} == set()


def test_names_in_code_that_the_guide_for_contributors_names_exist():
    sources = [
        path
        for folder in ("dsc", "planning", "knowledge_base", "domains", "tests")
        for path in (ROOT / folder).rglob("*.py")
    ]
    sources.append(ROOT / "frontend" / "src" / "core" / "plots.ts")
    words = set(re.findall(r"\w+", "\n".join(path.read_text() for path in sources)))
    assert named_in_the_guide(r"^(\w*(?:_|[a-z][A-Z]|[A-Z]{2})\w*)$") - words == set()


ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text()
PACKAGES = ("knowledge_base", "dsc", "planning", "domains")


def named_in_code(text):
    """The Python names in code spans."""
    return {span for span in re.findall(r"`([^`\n]+)`", text) if re.fullmatch(r"\w+(\.\w+)*", span)}


def test_rooms_and_methods_that_the_architecture_names_exist():
    dotted = {name for name in named_in_code(ARCHITECTURE) if "." in name and name != "pyproject.toml"}
    rooms = {name for name in dotted if name.partition(".")[0] in PACKAGES}
    assert len(rooms) > 20
    for room in rooms:
        import_module(room)
    defined = classes()
    for method in dotted - rooms:
        owner, _, name = method.partition(".")
        assert name in defined[owner], method


def test_classes_that_the_architecture_names_exist():
    named = {name for name in named_in_code(ARCHITECTURE) if re.fullmatch(r"[A-Z]\w*[a-z]\w*", name)}
    assert len(named) > 30
    assert named - {*classes(), "Protocol"} == set()


def test_the_architecture_names_every_room():
    rooms = {
        ".".join(init.parent.relative_to(ROOT).parts)
        for package in PACKAGES
        for init in [*(ROOT / package).glob("__init__.py"), *(ROOT / package).glob("*/__init__.py")]
    }
    tables = set(re.findall(r"^\| `([\w.]+)`", ARCHITECTURE, flags=re.MULTILINE))
    shown = (ROOT / "docs" / "pictures" / "rooms.svg").read_text()
    assert rooms <= tables
    assert {room for room in rooms if f">{room.rpartition('.')[2]}<" not in shown} == set()


def table_of(package):
    """The rooms of a package in the order of its table, each with the code spans of its last column."""
    section = ARCHITECTURE.split(f"### `{package}`")[1].split("\n### ")[0].split("\n## ")[0]
    rows = re.findall(r"^\| `([\w.]+)`.*\|([^|]*)\|$", section, flags=re.MULTILINE)
    return {room.rpartition(".")[2]: {*re.findall(r"`([\w.]+)`", last)} for room, last in rows}


def test_the_table_of_planning_lists_all_its_imports():
    arrows = house.arrows("planning")
    real = {room: {b.rpartition(".")[2] for a, b in arrows if a == f"planning.{room}"} for room in table_of("planning")}
    public = (ROOT / "planning" / "__init__.pyi").read_text()
    real["planning"] = set(re.findall(r"^from planning\.(\w+)\.", public, flags=re.MULTILINE))
    assert table_of("planning") | {"model": set()} == real


@pytest.mark.parametrize("package", ["planning", "domains"])
def test_a_room_imports_rooms_of_lower_rows_only(package):
    rows = list(table_of(package))
    arrows = [(one.split(".")[1], other.split(".")[1]) for one, other in house.arrows(package)]
    assert [(one, other) for one, other in arrows if rows.index(one) >= rows.index(other)] == []


def classes():
    """The names in the body of each class of the project, by the name of the class."""
    found: dict[str, set[str]] = {}
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.walk(parse_program(path.read_text())):
                if isinstance(node, ast.ClassDef):
                    body = {one.name for one in node.body if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef)}
                    found.setdefault(node.name, set()).update(body)
    return found


def test_the_glossary_names_code_that_exists():
    rows = re.findall(r"^\|.*\| ([^|]+) \|$", (ROOT / "docs" / "glossary.md").read_text(), flags=re.MULTILINE)
    named = {name for row in rows for name in named_in_code(row) if name.partition(".")[0] in PACKAGES}
    assert len(named) > 40
    for name in named:
        pkgutil.resolve_name(name)


@pytest.mark.parametrize("page", sorted((ROOT / "docs").glob("*.md")), ids=lambda page: page.stem)
def test_pages_name_modules_and_names_that_exist(page):
    prose = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    for name in re.findall(r"`((?:dsc|planning|knowledge_base|domains)(?:\.\w+)+)[`(]", prose):
        pkgutil.resolve_name(name)


UNITS = {"": 1, " s": 1, " MiB": 1 << 20, " GiB": 1 << 30}


def test_every_limit_on_the_page_is_the_one_in_the_code():
    page = (ROOT / "docs" / "limits.md").read_text()
    rows = re.findall(r"^\| `([\w.]+)\.(\w+)` \| (\d+)( \w+)? \|", page, flags=re.MULTILINE)
    assert len(rows) > 20
    for module, name, number, unit in rows:
        value = getattr(import_module(module), name)
        assert value == int(number) * UNITS[unit], f"{module}.{name} is {value}"


TABLE = ROOT / "domains" / "clean_up_table" / "plots"
PICTURES = {
    "clean_up_table": TABLE,
    "search": TABLE,
    "achieve": ROOT / "planning" / "plots",
    "life_cycle": ROOT / "docs" / "plots",
}


@pytest.mark.parametrize("name", PICTURES)
def test_the_pictures_are_what_the_project_draws_today(name):
    picture = (ROOT / "docs" / "pictures" / f"{name}.svg").read_text()
    folder = PICTURES[name]
    assert picture == draw(load_plot(folder / f"{name}.yaml"), load_library(folder)), "make pictures"


@pytest.mark.parametrize(("name", "options"), [("deployment", []), ("worst_cases", ["--timeline"])])
def test_the_pictures_of_the_deployment_are_what_the_project_draws_today(name, options):
    dsc = Path(sys.executable).with_name("dsc")
    command = [dsc, "deployment", "draw", ROOT / "examples" / "strangers" / "lab.yaml", *options]
    drawn = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert (ROOT / "docs" / "pictures" / f"{name}.svg").read_text() == drawn, "make pictures"


def test_every_picture_is_shown_somewhere():
    shown = "".join(page.read_text() for page in PAGES)
    pictures = {picture.name for picture in (ROOT / "docs" / "pictures").iterdir()}
    assert pictures >= {f"{name}.svg" for name in PICTURES}
    assert [name for name in sorted(pictures) if f"pictures/{name}" not in shown] == []


def test_the_sessions_with_a_store_are_what_the_command_prints(tmp_path):
    shutil.copy(ROOT / "examples" / "kitchen" / "domain.pddl", tmp_path)
    dsc = Path(sys.executable).with_name("dsc")
    for block in blocks(ROOT / "docs" / "knowledge.md", "console"):
        for shown in block.split("$ dsc ")[1:]:
            command, _, expected = shown.partition("\n")
            words: list[str | Path] = [dsc, *shlex.split(command)]
            done = subprocess.run(words, check=False, capture_output=True, text=True, cwd=tmp_path)
            assert done.stdout + done.stderr == expected


def test_the_run_on_the_first_screen_is_what_the_command_prints():
    (shown,) = [block for block in blocks(ROOT / "README.md", "console") if block.startswith("$ dsc run")]
    command, *lines = shown.splitlines()
    words = command.removeprefix("$ dsc ").split()
    dsc = Path(sys.executable).with_name("dsc")
    printed = iter(subprocess.run([dsc, *words], capture_output=True, text=True, check=True).stdout.splitlines())
    for line in lines:
        assert line.strip() == "…" or line in printed, line  # `in` goes on where the last line was found


def test_the_first_robot_is_made_as_its_page_says(tmp_path):
    page = (ROOT / "docs" / "first-robot.md").read_text()
    home, dsc = tmp_path / "coffee", Path(sys.executable).with_name("dsc")
    subprocess.run([dsc, "new", "coffee"], cwd=tmp_path, check=True, capture_output=True)
    for old in [*home.glob("coffee/plots/*"), *home.glob("coffee/profiles/*")]:
        old.unlink()
    tested = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    first, numbers = page.split("## A number, and a picture")
    assert _follow(first, home, dsc) == 17
    assert subprocess.run(tested, cwd=home, check=False, capture_output=True).returncode == 0
    if not engine("kairos").lacks():  # the last part needs the extra `numbers`
        (home / "coffee" / "profiles" / "on_tracks.yaml").unlink()
        assert _follow(numbers, home, dsc) == 4
        assert subprocess.run(tested, cwd=home, check=False, capture_output=True).returncode == 0


_FILE_OR_SESSION = re.compile(
    r"^`((?:coffee|tests)/\S+)`[^\n]*:\n\n```\w+\n(.*?)^```|^```console\n(.*?)^```", re.MULTILINE | re.DOTALL
)


def _follow(text: str, home: Path, dsc: Path) -> int:
    """Write the files and run the sessions of a page in their order; return the number of files."""
    files = 0
    for name, content, session in _FILE_OR_SESSION.findall(text):
        if name:
            (home / name).parent.mkdir(exist_ok=True)
            (home / name).write_text(content)
            files += 1
        for shown in session.split("$ dsc ")[1:] if "$ dsc new" not in session else ():
            command, _, expected = shown.partition("\n")
            done = subprocess.run([dsc, *shlex.split(command)], cwd=home, check=False, capture_output=True, text=True)
            assert done.stdout == expected, command
    return files


@pytest.mark.parametrize("package", ["knowledge_base", "dsc", "planning", "domains"])
def test_the_architecture_page_names_each_room(package):
    page = (ROOT / "docs" / "architecture.md").read_text()
    inside = [one for one in (ROOT / package).iterdir() if not one.name.startswith("__")]
    rooms = {one.stem for one in inside if one.suffix == ".py" or any(one.glob("*.py"))} - {"project_template"}
    named = set(re.findall(rf"`(?:{package}\.)?(\w+)`", page))
    assert rooms <= named, sorted(rooms - named)
