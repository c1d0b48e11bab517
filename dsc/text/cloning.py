"""Cloning: copies of plots and their files for another robot, with all plots on which they depend (S2.10)."""

from __future__ import annotations

import os
import re
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsc.dynamic.knowledge_situation import ACHIEVE
from dsc.dynamic.library import Library, require_substitute
from dsc.model.plot import ActionPlot
from dsc.model.plot import Path as FormPath
from dsc.model.states import DynamicState
from dsc.text.plot_files import Neighbours, file_of, load_plot, parse_plot, plot_to_yaml
from dsc.text.profiles import BY_PLOT, Profile, adapted, load_profile, profile_to_yaml
from dsc.text.yaml import read_file
from knowledge_base.errors import InputError, Place, SchemaError, UnknownNameError
from knowledge_base.output_files import Output, write_all

_ROLE = ("implements", "effects", "confirm")
"""Fields of a plot that concern the planning action that the plot implements."""


def cloned(plot: ActionPlot, library: Library, prefix: str, *, made: Library | None = None) -> tuple[ActionPlot, ...]:
    """Return clones of a plot and of all plots on which it depends; the prefix precedes their names.

    Each clone refers to the other clones.

    Args:
        plot: the plot to clone.
        library: provider of the plots on which `plot` depends.
        prefix: common beginning of the clones' names.
        made: another library for the clones; a plot in this library with the name of a clone is an earlier clone. In
            this library, clones implement planning actions in place of their originals. A goal then depends on all
            plots that implement planning actions. With `None`, clones share the originals' library and implement no
            planning actions, so that existing plans stay unchanged.

    Returns:
        The new clones, without earlier clones; a new clone of `plot` is the first one.

    Raises:
        UnknownNameError: a plot refers to a missing plot.
        SchemaError: an earlier clone no longer fits as a substitute of its original; the message has the reason.
    """
    apart = made is not None
    known = library if made is None else made
    names = {one.name: prefix + one.name for one in _dependencies(plot, library, plans=apart)}
    new = []
    for name, other in names.items():
        if other in known:
            require_substitute(library.plot(name), known.plot(other))
        else:
            new.append(_rename(library.plot(name), names, plans=apart))
    return tuple(new)


def cloned_profile(profile: Profile, prefix: str, names: Container[str]) -> Profile:
    """Return a profile for clones: `prefix` precedes its name and, in its values, the names of the plots in `names`."""
    groups = {
        group: {prefix + name if name in names else name: values for name, values in getattr(profile, group).items()}
        for group in BY_PLOT
    }
    return profile.model_copy(update={"name": prefix + profile.name, **groups})


def _dependencies(plot: ActionPlot, library: Library, *, plans: bool) -> Iterable[ActionPlot]:
    found: dict[str, ActionPlot] = {}
    waiting = [plot]
    while waiting:
        one = waiting.pop(0)
        if one.name not in found:
            found[one.name] = one
            waiting += [library.plot(name) for _, name in one.references() if name != ACHIEVE]
            if plans and any(isinstance(state, DynamicState) and state.goal is not None for _, state, _ in one.walk()):
                waiting += [other for other in library if other.implements]
    return found.values()


def _rename(plot: ActionPlot, names: Mapping[str, str], *, plans: bool) -> ActionPlot:
    form = plot.to_form()
    form["plot"] = names[plot.name]
    for path, name in plot.references():
        around: Any = form
        for key in path[:-1]:
            around = around[key]
        around[path[-1]] = names.get(name, name)
    if not plans:
        form = {key: value for key, value in form.items() if key not in _ROLE}
    return ActionPlot.model_validate(form)


_KEY = r"""["']?[\w\-]+["']?\s*:\s*"""


@dataclass(frozen=True, slots=True)
class Clones:
    """The result of cloning, before any file is written.

    Attributes:
        texts: the new text of each file to write.
        kept: files that contain earlier clones and stay unchanged.
    """

    texts: Mapping[Path, str]
    kept: tuple[Path, ...]


def clone_files(file: Path, prefix: str, into: Path | None = None, profiles: Sequence[Path] = ()) -> Clones:
    """Return clones of a plot file and of each file with a plot that it depends on; write no file.

    Args:
        file: the plot file; its folder must contain the plots on which the plot depends.
        prefix: common beginning of the names of clones and of their files.
        into: another folder for the clones; see `made` in `dsc.text.cloning.cloned`. `None` means the folder of `file`.
        profiles: files of profiles to clone; a cloned profile sets the parameters of the cloned plots.

    Raises:
        InputError: a file cannot be read or already exists, or a plot refers to a missing plot. The prefix cannot begin
            a name, two clones have an equal file name, or an earlier clone no longer fits.
    """
    if not re.fullmatch(r"[a-zA-Z_][\w\-]*", prefix):
        raise SchemaError(f"no name begins with '{prefix}': letters, digits, _ and -, a letter first", found=prefix)
    folder = file.parent if into is None else into
    apart = os.path.realpath(folder) != os.path.realpath(file.parent)
    plot = load_plot(file)
    library, broken = Neighbours().of(file, plot)
    there = dict(_plots_in(folder))
    made = Library(there.values())
    if not apart:
        library = Library({one.name: one for one in (*library, *made)}.values())
    try:
        clones = cloned(plot, library, prefix, made=made if apart else None)
    except UnknownNameError as error:  # an unreadable file may contain the missing plot
        raise (broken or [error])[0] from None
    new = {clone.name: clone for clone in clones}
    names = {one.name: prefix + one.name for one in library if prefix + one.name in (*new, *(p.name for p in made))}
    originals = {name: library.plot(old) for old, name in names.items() if name in new}
    texts: dict[Path, str] = {}
    for name, one in originals.items():
        target = folder / f"{prefix}{_stem(one)}.yaml"
        if os.path.lexists(target):
            raise InputError("the file is there already, and holds no clone", place=Place(str(target)))
        _add(texts, target, _text(one, new[name], names))
    kept = [path for path, one in there.items() if one.name in names.values()]
    for profile in profiles:
        target = folder / f"{prefix}{profile.name}"
        read = load_profile(profile)
        known = {
            group: {name: values for name, values in getattr(read, group).items() if name in library}
            for group in BY_PLOT
        }
        adapted(library, read.model_copy(update=known))  # a value may not fit
        text = profile_to_yaml(cloned_profile(read, prefix, names))
        if os.path.lexists(target):
            kept.append(target)
        else:
            _add(texts, target, text)
    return Clones(texts, tuple(kept))


def write_clones(clones: Clones) -> None:
    """Write either all files of the clones or none; create a missing folder.

    Raises:
        InputError: the folder or a file cannot be written.
        OSError: the disk is full.
    """
    for folder in {target.parent for target in clones.texts}:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot make the folder '{folder}': {error.strerror}") from None
    write_all({Output(target, "clone"): text for target, text in clones.texts.items()})


def _add(texts: dict[Path, str], target: Path, text: str) -> None:
    if target in texts:
        raise InputError("two clones would be this file; rename a plot's file or a profile", place=Place(str(target)))
    texts[target] = text


def _plots_in(folder: Path) -> Iterator[tuple[Path, ActionPlot]]:
    """Yield file and plot of each readable plot file in a folder."""
    for file in sorted(folder.glob("*.yaml")):
        with suppress(InputError):
            yield file, load_plot(file)


def _stem(plot: ActionPlot) -> str:
    file = file_of(plot)
    return plot.name if file is None else file.stem


def _text(original: ActionPlot, clone: ActionPlot, names: Mapping[str, str]) -> str:
    """Return the original's text with the clones' names if it reads as the clone; else the clone's YAML."""
    file = file_of(original)
    if file is not None:
        text = _substitute(read_file(file), original, names)
        lost = [key for key in original.to_form() if key not in clone.to_form()]
        text = "".join(line for line in text.splitlines(keepends=True) if line.partition(":")[0] not in lost)
        with suppress(InputError):
            if parse_plot(text).text == clone.text:
                return text
    return plot_to_yaml(clone)


def _substitute(text: str, plot: ActionPlot, names: Mapping[str, str]) -> str:
    """Return the text with new names of plots, replaced from the end, so that earlier places stay valid."""
    lines = text.splitlines(keepends=True)
    for line, column, path, old in sorted(_find_occurrences(plot), key=lambda one: one[:2], reverse=True):
        key = _KEY if isinstance(path[-1], str) else ""
        before, rest = lines[line - 1][: column - 1], lines[line - 1][column - 1 :]
        found = re.match(rf"""({key}["']?){re.escape(old)}(?![\w\-#.])""", rest)
        if found is not None:
            lines[line - 1] = before + found[1] + names.get(old, old) + rest[found.end() :]
    return "".join(lines)


def _find_occurrences(plot: ActionPlot) -> Iterator[tuple[int, int, FormPath, str]]:
    """Yield line, column, path and name of each occurrence of a plot's name in the text of `plot`."""
    for path, name in ((("plot",), plot.name), *plot.references()):
        place = plot.place(path)
        if place is not None and place.line is not None and place.column is not None:
            yield place.line, place.column, path, name
