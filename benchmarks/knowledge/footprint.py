"""How much memory facts take: what a process has more of when it holds them, whatever language keeps them."""

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
    """What a process of its own measures; `None` where the system does not say."""
    if not _PAGES.exists():
        return None
    command = [sys.executable, "-c", _CODE, str(Path(__file__).parents[1]), name, str(size)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def main(name: str, size: str) -> None:
    """Print the bytes that a fact takes; names made as text count for none, for all start with the same ones."""
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
