"""Command `dsc plot`: check, show, draw, convert, compare, rename and clone action plots."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsc.cli.findings import JSON, SARIF, SELECT, STRICT, report
from dsc.cli.renaming import rename_command
from dsc.errors import Finding
from knowledge_base.cli.console import print_json
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.spelling import number_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from dsc.components.component import Component
    from dsc.dynamic.library import Library
    from dsc.model.plot import ActionPlot
    from dsc.text.plot_files import Neighbours
    from knowledge_base.world.schema import Schema

app = typer.Typer(
    name="plot",
    rich_markup_mode=None,
    no_args_is_help=True,
    help="Check, show and draw action plots.",
)
app.command("rename")(rename_command)

BAD_INPUT = 2
"""Exit status of `check` with findings, and of every command with invalid input."""
UNKNOWN_PLOT = "known-plot"
"""The code of findings that may result from an unreadable neighbouring file."""
MAX_BROKEN = 3
"""Maximum number of unreadable neighbouring files that are reported."""
PIPE_WIDTH = 160
"""Columns of a tree that is not printed on a terminal."""


_find: list[Callable[[str], tuple[Component, ...]]] = []


def register_targets(find: Callable[[str], tuple[Component, ...]]) -> None:
    """Let `--robot` accept the targets for which `find` returns components; otherwise it accepts `MODULE:NAME`."""
    _find.append(find)


def _components_of(target: str) -> tuple[Component, ...]:
    from dsc.components.assembly import robot_of

    return (_find[-1] if _find else robot_of)(target)


@app.command()
def check(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Plots (YAML) or charts (.scxml).")],
    domain: Annotated[
        Path | None,
        typer.Option(
            "--domain",
            metavar="D.pddl",
            help="What conditions may speak of.  [default: domain.pddl beside FILE or one folder up]",
        ),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            metavar="TARGET",
            help="A robot, or components at MODULE:NAME: then skills and parameters are checked, too.",
        ),
    ] = None,
    json: JSON = False,
    sarif: SARIF = False,
    select: SELECT = None,
    strict: STRICT = False,
) -> None:
    """Report the mistakes of plots, one finding per line; warnings report forms that are allowed but rarely intended.

    A plot may use the other plots in its folder. Exit status: 0 without findings, or with warnings only; 2 with
    findings.
    """
    from dsc.text.plot_files import Neighbours

    neighbours = Neighbours()
    components = None if robot is None else _components_of(robot)
    every = [(file, finding) for file in files for finding in _findings(file, domain, neighbours, components)]
    nothing = f"{number_text(len(files), 'plot')} checked, no mistakes found"
    wrong = report(every, nothing, json=json, sarif=sarif, selection=select, strict=strict)
    raise typer.Exit(BAD_INPUT if wrong else 0)


@app.command()
def show(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A plot file (YAML).")],
    svg: Annotated[
        str | None, typer.Option("--svg", metavar="OUT.svg", help="Draw it to a file; - is standard output.")
    ] = None,
    yaml: Annotated[bool, typer.Option("--yaml", help="Print it as YAML.")] = False,
    expanded: Annotated[
        bool, typer.Option("--expanded", help="With its rules carried out, as drawings always have them.")
    ] = False,
) -> None:
    """Show a plot: as a tree in the terminal, as a drawing, or as YAML."""
    from dsc.drawing import draw
    from dsc.text.plot_files import Neighbours, load_plot, plot_to_yaml
    from knowledge_base.output_files import Output

    out = None if svg is None else Output(svg, "--svg", file)
    plot = load_plot(file)
    library, broken = Neighbours().of(file, plot)
    if out is not None:
        out.keep(*_files(library))
    try:
        shown = library.expanded(plot) if expanded else plot
        drawing = "" if out is None else draw(plot, library)
    except UnknownNameError as error:
        # A missing plot may be in an unreadable file; then the error identifies the file.
        raise (broken or [error])[0] from None
    if out is not None:
        out.write(drawing)
    if yaml:
        typer.echo(plot_to_yaml(shown), nl=False)
    elif out is None:
        _print_tree(shown)


@app.command("import")
def import_(
    file: Annotated[Path, typer.Argument(metavar="FILE.scxml", help="A chart in SCXML.")],
    out: Annotated[
        str, typer.Option("--out", metavar="FILE.yaml", help="Where the plot goes; - is standard output.")
    ] = "-",
) -> None:
    """Read an SCXML chart as a plot of dialect `scxml`; report constructs that a plot cannot express."""
    from dsc.dynamic.library import Library
    from dsc.scxml.reader import parse_scxml
    from dsc.text.plot_files import plot_to_yaml
    from dsc.text.yaml import read_file
    from dsc.validation import raise_findings, validate_plot
    from knowledge_base.output_files import Output

    output = Output(out, "--out", file)
    plot = parse_scxml(read_file(file), str(file))
    raise_findings(validate_plot(plot, Library([plot])))
    output.write(plot_to_yaml(plot))


@app.command()
def export(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A plot file (YAML).")],
    to: Annotated[str, typer.Option("--to", metavar="FORM", help="scxml, mermaid, plantuml or svg.")],
    out: Annotated[str, typer.Option("--out", metavar="OUT", help="Where it goes; - is standard output.")] = "-",
) -> None:
    """Write a plot in another form; report constructs that the form cannot express."""
    from dsc.drawing import draw
    from dsc.scxml.writer import to_scxml
    from dsc.text.plot_files import Neighbours, load_plot
    from dsc.text.text_diagrams import to_mermaid, to_plantuml
    from knowledge_base.output_files import Output

    def to_svg(plot: ActionPlot) -> str:
        library, _ = Neighbours().of(file, plot)
        output.keep(*_files(library))
        return draw(plot, library)

    forms: dict[str, Callable[[ActionPlot], str]] = {
        "scxml": to_scxml,
        "mermaid": to_mermaid,
        "plantuml": to_plantuml,
        "svg": to_svg,
    }
    if to not in forms:
        raise InputError(f"there is no form '{to}'", found=to, valid=forms)
    output = Output(out, "--out", file)
    output.write(forms[to](load_plot(file)))


@app.command()
def diff(
    old: Annotated[Path, typer.Argument(metavar="OLD", help="A plot file.")],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="Another one.")],
    svg: Annotated[
        str | None, typer.Option("--svg", metavar="OUT.svg", help="Draw both, one above the other, with marks.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print a JSON list of differences.")] = False,
) -> None:
    """Report the differences between two plots. Exit status: 0 without differences, 1 with differences."""
    from dsc.drawing.svg import above
    from dsc.text.plot_difference import differences, draw_difference
    from knowledge_base.output_files import Output

    out = None if svg is None else Output(svg, "--svg", old, new)
    before, after = load_chart(old), load_chart(new)
    found = differences(before, after)
    if json:
        print_json([asdict(difference) for difference in found])
    else:
        for difference in found:
            typer.echo(str(difference))
    if out is not None:
        out.write(above(*draw_difference(before, after)))
    raise typer.Exit(1 if found else 0)


@app.command()
def clone(
    file: Annotated[Path, typer.Argument(metavar="PLOT", help="A plot file (YAML); what it uses is in its folder.")],
    prefix: Annotated[str, typer.Option("--prefix", metavar="X", help="Stands before all new names.")],
    into: Annotated[
        Path | None, typer.Option("--into", metavar="FOLDER", help="Where the clones go.  [default: beside PLOT]")
    ] = None,
    profile: Annotated[
        list[Path] | None, typer.Option("--profile", metavar="P.yaml", help="A profile to be cloned with them.")
    ] = None,
) -> None:
    """Clone a plot for another robot, with all plots that it depends on; existing clones are used."""
    from dsc.text.cloning import clone_files, write_clones

    found = clone_files(file, prefix, into, profile or ())
    write_clones(found)
    for target in found.texts:
        typer.echo(f"made {target}")
    for target in found.kept:
        typer.echo(f"kept {target}, which was made before")


@app.command()
def schema(
    profile: Annotated[bool, typer.Option("--profile", help="That of profiles instead.")] = False,
) -> None:
    """Print the JSON Schema of plot files, for editors."""
    from dsc.text.plot_files import json_schema
    from dsc.text.profiles import profile_schema

    print_json(profile_schema() if profile else json_schema())


@app.command()
def types(
    sources: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Plots (YAML), or folders of plots.")],
    domain: Annotated[
        Path | None,
        typer.Option(
            "--domain", metavar="D.pddl", help="The types.  [default: domain.pddl beside FILE or one folder up]"
        ),
    ] = None,
) -> None:
    """Print a Python module with a typed function for each plot, for type checkers and editors."""
    from dsc.text.plot_files import load_library
    from dsc.text.typed_plots import typed_plots

    plots = [plot for one in sources for plot in (load_library(one) if one.is_dir() else [load_chart(one)])]
    first = sources[0]
    typer.echo(typed_plots(plots, _schema(first / "any" if first.is_dir() else first, domain)), nl=False)


def _findings(
    file: Path, domain: Path | None, neighbours: Neighbours, components: tuple[Component, ...] | None
) -> list[Finding]:
    """Return the findings about one file; an unreadable file is one finding."""
    from dsc.validation import review_plot, validate_plot
    from dsc.validation.ignored import without_ignored

    known = _schema(file, domain)
    try:
        plot = load_chart(file)
        library, broken = neighbours.of(file, plot)
        skills = None if components is None else [one for c in components for one in c.skills().values()]
        declared = None if components is None else {c.name: c.interface() for c in components}
        findings = validate_plot(plot, library, known, skills, declared) or review_plot(plot, library, skills)
    except InputError as error:
        return [Finding(error, "readable")]
    findings = without_ignored(findings, [file])
    if any(finding.code == UNKNOWN_PLOT for finding in findings):
        findings += [Finding(error, "readable") for error in broken[:MAX_BROKEN]]
    return findings


def load_chart(file: Path) -> ActionPlot:
    """Return the plot in a file; the file is read as SCXML if its name ends in `.scxml`."""
    from dsc.scxml.reader import parse_scxml
    from dsc.text.plot_files import load_plot
    from dsc.text.yaml import read_file

    return parse_scxml(read_file(file), str(file)) if file.suffix == ".scxml" else load_plot(file)


def _schema(file: Path, domain: Path | None) -> Schema | None:
    from knowledge_base.world.schema import Schema

    if domain is not None:
        return Schema.from_pddl(domain)
    folder = Path(os.path.realpath(file)).parent
    places = (folder / "domain.pddl", folder.parent / "domain.pddl")
    found = next((place for place in places if place.is_file()), None)
    return None if found is None else Schema.from_pddl(found)


def _files(library: Library) -> list[Path]:
    """Return the files from which the plots of a library were read."""
    places = [plot.place(("plot",)) for plot in library]
    return [Path(place.source) for place in places if place is not None and place.source]


def _print_tree(plot: ActionPlot) -> None:
    from rich.console import Console

    from dsc.drawing.tree import plot_tree

    console = Console()
    if not console.is_terminal:
        console = Console(width=PIPE_WIDTH)
    console.print(plot_tree(plot))
