"""Watch of the files of a robot's plots: a run receives what their author changes (S2.8)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from threading import Event, Thread

from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.sequencer.sequencer import Sequencer
from dsc.text.plot_files import file_of, parse_plot
from dsc.text.profiles import Profile, with_profile
from knowledge_base.errors import InputError
from knowledge_base.pddl.unsaved_texts import readable_text
from planning.robot.project_files import YAML, plot_name

SECONDS = 0.3
"""Real time between two looks at the files."""


class PlotFiles:
    """The plot files in the folders of a robot's plots.

    Args:
        library: the plots of the robot; those that were read from files name their folders.
        profile: the settings profile of the robot, which also sets the defaults of changed plots.
    """

    def __init__(self, library: Library, profile: Profile | None = None) -> None:
        files = filter(None, map(file_of, library))
        self._folders = sorted({file.parent for file in files if file.is_file()})
        self._profile = profile
        self._texts = self._read({})

    def update(self, sequencer: Sequencer) -> Iterator[str]:
        """Change the plots of a run as the files have changed; yield a line for each change and each mistake."""
        before, self._texts = self._texts, self._read(self._texts)
        changed = {file: text for file, text in self._texts.items() if before.get(file) != text}
        plots: list[ActionPlot] = []
        for file, text in changed.items():
            try:
                plot = parse_plot(text, str(file))
                plots.append(plot if self._profile is None else with_profile(plot, self._profile))
            except InputError as error:
                yield f"not changed: {error}"
        library = sequencer.library
        new = [plot for plot in plots if plot.name not in library]
        edited = [plot for plot in plots if plot.name in library]
        left = {plot_name(file, text) for file, text in self._texts.items()}
        gone = [plot_name(file, text) for file, text in before.items() if file not in self._texts]
        removed = [name for name in gone if name is not None and name in library and name not in left]
        if new:
            yield _outcome("installed", [plot.name for plot in new], partial(sequencer.install, new))
        if edited:
            replace = partial(sequencer.replace, edited, active="keep")
            yield _outcome("replaced", [plot.name for plot in edited], replace)
        for name in removed:
            yield _outcome("removed", [name], partial(sequencer.remove, name))

    def _read(self, before: Mapping[Path, str]) -> dict[Path, str]:
        """Return the texts of the plot files; a file without a plot that had one is being written by an editor."""
        files = [file for folder in self._folders for file in sorted(folder.iterdir()) if file.suffix in YAML]
        texts = {file: readable_text(file) for file in files}
        plots = {file: text for file, text in texts.items() if plot_name(file, text) is not None}
        return {**{file: text for file, text in before.items() if file in texts}, **plots}


def _outcome(what: str, names: Iterable[str], change: Callable[[], None]) -> str:
    """Make one change of the run, and return its line; a mistake leaves the run unchanged."""
    try:
        change()
    except InputError as error:
        return f"not {what}: {error}"
    return f"{what}: {', '.join(names)}"


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
