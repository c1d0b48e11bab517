"""Related plots in a plot's folder: only files of needed plots are parsed, so that other files cost nothing."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.model.states import DynamicState
from dsc.text.plot_files import parse_plot
from dsc.text.text_files import read_file
from knowledge_base.errors import InputError

_DECLARES = re.compile(r"""\bplot["']?\s*:\s*["']?([\w\-#.]+)""")


class Neighbours:
    """Folders of plots; each file is read once for all plots of its folder."""

    def __init__(self) -> None:
        self._folders: dict[Path, dict[Path, str | InputError]] = {}
        self._plots: dict[Path, ActionPlot | InputError] = {}

    def of(self, file: Path, plot: ActionPlot) -> tuple[Library, list[InputError]]:
        """Return the plot with its related plots, and the errors of files that could not be read.

        Related plots are the used ones, directly or not, and with rules or plans also the implementations of planning
        actions. If one of them is missing, all plots of the folder are read: its name may be a misspelt one.
        """
        library, broken = Library([plot]), list[InputError]()
        planned = any(isinstance(state, DynamicState) for _, state, _ in plot.walk())
        if not (plot.uses() or plot.rules or planned):
            return library, broken
        here, texts = os.path.realpath(file), self._texts(file.parent)
        left = {other: text for other, text in texts.items() if os.path.realpath(other) != here}
        actions = bool(plot.rules) or planned
        while True:
            missing = {name for known in library for name in known.uses() if name not in library}
            next_ = list(_holding(left, missing, actions=actions)) or (list(left) if missing else [])
            if not next_:
                return library, broken
            for other in next_:
                found = self._plot(other, left.pop(other))
                try:
                    if isinstance(found, InputError):
                        raise found
                    library.add(found)
                except InputError as error:
                    broken.append(error)

    def _texts(self, folder: Path) -> dict[Path, str | InputError]:
        if folder not in self._folders:
            self._folders[folder] = {file: _text(file) for file in sorted(folder.glob("*.yaml"))}
        return self._folders[folder]

    def _plot(self, file: Path, text: str | InputError) -> ActionPlot | InputError:
        if file not in self._plots:
            try:
                self._plots[file] = parse_plot(text, str(file)) if isinstance(text, str) else text
            except InputError as error:
                self._plots[file] = error
        return self._plots[file]


def _holding(texts: dict[Path, str | InputError], names: set[str], *, actions: bool) -> Iterator[Path]:
    """Yield the files that seem to contain one of these plots, or an implementation of a planning action."""
    for file, text in texts.items():
        if isinstance(text, str) and (
            not names.isdisjoint(_DECLARES.findall(text)) or (actions and "implements" in text)
        ):
            yield file


def _text(file: Path) -> str | InputError:
    try:
        return read_file(file)
    except InputError as error:
        return error
