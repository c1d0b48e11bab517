"""Command `dsc new`: a running robot project to start from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Iterator
    from importlib.resources.abc import Traversable

TEMPLATE, PACKAGE = "project_template", "my_robot"
"""The folder of the template in this package, and the name in the template that the new name replaces."""
_DOTTED = {"gitignore": ".gitignore", "vscode": ".vscode"}
"""Names in the template without the dot that they have in a project."""


def new_command(
    name: Annotated[str, typer.Argument(metavar="NAME", help="The project's name; a new folder with this name.")],
    plots: Annotated[
        list[Path] | None,
        typer.Option(
            "--from",
            metavar="PLOTS",
            help="A plot file or a folder with plots, repeatable: make the project of these plots, with simulated"
            " skills. In an existing project, write only its generated files again.",
        ),
    ] = None,
) -> None:
    """Make a running robot project: domain, plots, skills, simulation, test, and settings of an editor."""
    package = _package(Path.cwd().name if name == "." else name)
    if plots:
        _new_from(plots, Path(name), package)
        return
    folder = _free(Path(name))
    texts = {path: text.replace(PACKAGE, package) for path, text in _template(package)}
    _write_new(folder, {**texts, **_schemas()})


def _new_from(plots: list[Path], folder: Path, package: str) -> None:
    """Make a project of plots, or write the generated files of such a project again."""
    from planning.cli.skeleton import GENERATED, PlotProject

    project = PlotProject.of(package, plots)
    inside = folder / package
    if (inside / GENERATED).is_file():
        _write_again(inside, project.generate(), project.skills(), project.copies())
        return
    _free(folder)
    parts = {**project.first_texts(), **project.generate(), **project.skills(), **project.copies()}
    texts = {Path(package) / path: text for path, text in parts.items()}
    texts[Path("tests") / f"test_{package}.py"] = project.test()
    common = {Path("pyproject.toml"), Path(".gitignore"), Path(".vscode/settings.json")}
    template = {path: text.replace(PACKAGE, package) for path, text in _template(package) if path in common}
    own = template[Path("pyproject.toml")].replace('readme = "README.md"\n', "")
    template[Path("pyproject.toml")] = own.replace("A delivery robot", "A robot, made from its plots")
    _write_new(folder, {**texts, **template, **_schemas()})


def _write_again(folder: Path, generated: dict[Path, str], first: dict[Path, str], plots: dict[Path, str]) -> None:
    """Write the generated files of a project, and those files of a person that do not exist yet.

    Args:
        folder: the package of the project.
        generated: the texts of generated files by path.
        first: the first texts of a person's files.
        plots: the texts of the plots; a plot of the project that differs stays, and is named.

    Raises:
        InputError: a generated file lacks the mark at its beginning.
    """
    from dsc.skeletons.python_code import MARK
    from knowledge_base.errors import InputError, Place

    for path in generated:
        if (folder / path).is_file() and not (folder / path).read_text("utf-8").startswith(f'"""{MARK}'):
            message = f"this file does not begin with '{MARK}', so it may be yours; move it, or restore its first line"
            raise InputError(message, place=Place(str(folder / path), 1))
    missing = {path: text for path, text in {**first, **plots}.items() if not (folder / path).exists()}
    for path, text in {**generated, **missing}.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, "utf-8")
        typer.echo(f"{'made' if path in missing else 'wrote again'} {folder / path}")
    for path, text in plots.items():
        if (folder / path).read_text("utf-8") != text:
            typer.echo(
                f"{folder / path} differs from the given plot and stays: copy the plot, or name the project's plots"
            )
    typer.echo("next:  dsc check    mypy --strict    (both name what your files lack now)")


def _write_new(folder: Path, texts: dict[Path, str]) -> None:
    for path, text in texts.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, "utf-8")
    typer.echo(f"made {folder}:")
    for path in sorted(texts, key=lambda path: (path.parts[0].startswith("."), path)):
        typer.echo(f"  {path}")
    typer.echo(f"next:  cd {folder}    dsc check    dsc run .    dsc run . --view    pytest")


def _schemas() -> dict[Path, str]:
    """Return the JSON Schemas of plots and profiles for an editor."""
    from json import dumps

    from dsc.text.plot_files import json_schema
    from dsc.text.profiles import profile_schema

    return {
        Path(".vscode/plot.schema.json"): dumps(json_schema(), indent=1) + "\n",
        Path(".vscode/profile.schema.json"): dumps(profile_schema(), indent=1) + "\n",
    }


def _package(name: str) -> str:
    """Return the name of the package; raise `InputError` for a name that cannot be imported or is taken."""
    from importlib.util import find_spec
    from keyword import iskeyword

    from knowledge_base.errors import InputError

    package = Path(name).name.replace("-", "_")
    if not package.isidentifier() or not package.isascii() or iskeyword(package):
        form = "letters, digits and '_', and begins with a letter, as in my_robot"
        raise InputError(f"a project's name has {form}; not '{name}'", found=name)
    if find_spec(package) is not None and not Path(name).is_dir():
        raise InputError(f"'{package}' is the name of an installed module; choose another name", found=name)
    return package


def _free(folder: Path) -> Path:
    from knowledge_base.errors import InputError, Place

    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        message = "there is something here; a new project needs a new or an empty folder"
        raise InputError(message, place=Place(str(folder)))
    return folder


def _template(package: str) -> Iterator[tuple[Path, str]]:
    """Yield path and text of each file of the template."""
    from importlib.resources import files

    def walk(inside: Traversable, path: Path) -> Iterator[tuple[Path, str]]:
        for one in sorted(inside.iterdir(), key=lambda one: one.name):
            name = _DOTTED.get(one.name, one.name.replace(PACKAGE, package))
            if one.is_dir() and name != "__pycache__":
                yield from walk(one, path / name)
            elif one.is_file():
                yield path / name, one.read_text("utf-8")

    yield from walk(files("planning") / TEMPLATE, Path())
