"""Watch of the files of a robot's plots: a run receives what their author changes (S2.8)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from threading import Event, Thread

from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.sequencer.sequencer import Sequencer
from dsc.text.plot_files import parse_plot
from dsc.text.profiles import Profile, adapted
from knowledge_base.errors import InputError
from planning.robot.project_files import is_plot, text_of

SECONDS = 0.3
"""Real time between two looks at the files."""


class PlotFiles:
    """The plot files in the folders of a robot's plots.

    Args:
        library: the plots of the robot; those that were read from files name their folders.
        profile: the settings profile of the robot, which also sets the defaults of changed plots.
    """

    def __init__(self, library: Library, profile: Profile | None = None) -> None:
        places = [plot.place(("plot",)) for plot in library]
        files = [Path(place.source) for place in places if place is not None and place.source is not None]
        self._folders = sorted({file.parent for file in files if file.is_file() and file.suffix != ".py"})
        self._profile = profile
        self._texts: dict[Path, str] = {}
        self._texts = self._read()
        self._names = {file: plot.name for file, text in self._texts.items() if (plot := _plot_in(file, text))}

    def update(self, sequencer: Sequencer) -> Iterator[str]:
        """Change the plots of a run as the files have changed; yield a line for each change and each mistake.

        Raises:
            InputError: the run has ended.
        """
        before, self._texts = self._texts, self._read()
        changed = {file: text for file, text in self._texts.items() if before.get(file) != text}
        plots: dict[Path, ActionPlot] = {}
        for file, text in changed.items():
            try:
                (plots[file],) = adapted([parse_plot(text, str(file))], self._profile)
            except InputError as error:
                yield f"not changed: {error}"
        library = sequencer.library
        new = {file: plot for file, plot in plots.items() if plot.name not in library}
        edited = {file: plot for file, plot in plots.items() if plot.name in library}
        yield from self._hand_in("installed", new, lambda: sequencer.install(new.values()))
        yield from self._hand_in("replaced", edited, lambda: sequencer.replace(edited.values(), active="keep"))
        for file in before.keys() - self._texts.keys():
            name = self._names.pop(file, "")
            if name in library and name not in self._names.values():
                yield from self._hand_in("removed", {}, partial(sequencer.remove, name), name)

    def _hand_in(
        self, what: str, plots: Mapping[Path, ActionPlot], change: Callable[[], None], name: str = ""
    ) -> Iterator[str]:
        """Make one change of the run, and yield its line; a mistake leaves the run unchanged."""
        names = [plot.name for plot in plots.values()] or [name] * bool(name)
        if not names:
            return
        try:
            change()
        except InputError as error:
            yield f"not {what}: {error}"
        else:
            self._names.update({file: plot.name for file, plot in plots.items()})
            yield f"{what}: {', '.join(names)}"

    def _read(self) -> dict[Path, str]:
        files = [file for folder in self._folders for file in sorted(folder.iterdir()) if is_plot(file)]
        unfinished = {file: text for file, text in self._texts.items() if file.exists()}  # an editor writes them now
        return {**unfinished, **{file: text_of(file) for file in files}}


def _plot_in(file: Path, text: str) -> ActionPlot | None:
    with suppress(InputError):
        return parse_plot(text, str(file))
    return None


@contextmanager
def watched_files(files: PlotFiles, say: Callable[[str], object]) -> Iterator[Callable[[Sequencer], None]]:
    """Yield a function that begins to change the plots of a run as the files change, until the end of the block.

    Args:
        files: the files.
        say: receives a line for each change and each mistake, in another thread.
    """
    over = Event()
    threads: list[Thread] = []

    def watch(sequencer: Sequencer) -> None:
        while not over.wait(SECONDS):
            for line in files.update(sequencer):
                say(line)

    def begin(sequencer: Sequencer) -> None:
        threads.append(Thread(target=watch, args=(sequencer,), name="plot files", daemon=True))
        threads[-1].start()

    try:
        yield begin
    finally:
        over.set()
        for thread in threads:
            thread.join()
