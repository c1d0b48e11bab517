"""The resources that the program of a component uses (S2.20)."""

from __future__ import annotations

import os
import time
from pathlib import Path

_STATM = Path("/proc/self/statm")
_MIB = 1024 * 1024


def program_use() -> dict[str, float | None]:
    """Return the id of this process, its processor time in seconds, and its memory in MiB (`None` if unknown)."""
    try:
        pages = int(_STATM.read_text("ascii").split()[1])
        memory = round(pages * os.sysconf("SC_PAGE_SIZE") / _MIB, 1)
    except (OSError, ValueError, IndexError):  # only Linux has this file
        memory = None
    return {"id": os.getpid(), "processor_s": round(time.process_time(), 3), "memory_mib": memory}
