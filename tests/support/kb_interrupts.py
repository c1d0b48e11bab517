"""Interrupts (Ctrl-C) that come at a chosen moment."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable


def interrupted(moment: int, work: Callable[[], None]) -> bool:
    """Whether the work was interrupted at that moment, or had so many not: as it enters a function, and as C returns.

    Those are the moments at which Python looks whether there was an interrupt.
    """
    left = moment

    def look(frame: object, event: str, arg: object) -> None:
        nonlocal left
        if event in ("call", "c_return"):
            if left == 0:
                raise KeyboardInterrupt  # it is not called again then
            left -= 1

    gc.disable()  # what it would run meanwhile is no part of the work
    sys.setprofile(look)
    try:
        work()
    except KeyboardInterrupt:
        return True
    finally:
        sys.setprofile(None)
        gc.enable()
    return False
