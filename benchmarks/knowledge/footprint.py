"""Memory of facts: the growth of a process that inserts them, in any language."""

from __future__ import annotations

import gc
import resource
import subprocess
import sys
from pathlib import Path

from knowledge import contenders
from knowledge.arcs import Arcs

_PAGES = Path("/proc/self/statm")
_CODE = "import sys; sys.path[:0] = [sys.argv[1]]; from knowledge.footprint import main; main(*sys.argv[2:])"


def bytes_a_fact(name: str, size: int) -> float | None:
    """Return the bytes a fact, measured by a separate process; `None` where the system has no figures."""
    if not _PAGES.exists():
        return None
    command = [sys.executable, "-c", _CODE, str(Path(__file__).parents[1]), name, str(size)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def main(name: str, size: str) -> None:
    """Print the bytes a fact; the text of names does not count, since all contenders start with it."""
    arcs = Arcs(int(size))
    batches = list(arcs.batches())
    one = next(kind for kind in contenders() if kind.name == name)()
    before = _held()
    for things, batch in batches:
        one.insert(things, batch)
    print((_held() - before) / (5 * arcs.size))


def _held() -> int:
    gc.collect()
    return int(_PAGES.read_text().split()[1]) * resource.getpagesize()
