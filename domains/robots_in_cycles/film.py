"""Films of drives, with the extra `physics`: what a camera behind the robot sees, with the active states of its plot.

No other module imports Pillow.
"""

from __future__ import annotations

import math
import os
import sys
from pathlib import Path

from domains.robots_in_cycles.drives import CYCLE, Course
from knowledge_base.errors import InputError

FORMATS = (".webp", ".gif", ".png")
"""Suffixes of films; `.png` is an animated PNG."""
_MOST = 600
"""Frames of a film; a longer drive has larger steps, and is shown faster."""
_FRAME_MS = 64


class Film:
    """A film of a drive; create it before the course, as it chooses how MuJoCo renders.

    Args:
        path: the file, whose suffix is one of `FORMATS`.
        seconds: the time of the drive.

    Raises:
        InputError: the suffix is another one, the folder is missing, or Pillow is not installed.
    """

    def __init__(self, path: Path, seconds: float) -> None:
        if path.suffix.lower() not in FORMATS:
            raise InputError(f"a film is a file with one of the suffixes {', '.join(FORMATS)}, but was '{path}'")
        if not path.parent.is_dir():
            raise InputError(f"the folder of the film '{path}' does not exist: create it, or choose another one")
        try:
            from PIL import Image, ImageDraw  # noqa: PLC0415  the extra may be missing
        except ImportError:
            remedy = "pip install 'dynamic-state-charts[physics]'"
            raise InputError(f"a film needs Pillow, which is not installed: {remedy}") from None
        self._image, self._draw = Image, ImageDraw
        self._path, self._frames = path, list[Image.Image]()
        self._every, self._cycles = max(2, math.ceil(seconds / CYCLE / _MOST)), 0
        if sys.platform == "linux" and not os.environ.get("DISPLAY"):
            os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo reads it when it is imported; GLFW needs a display

    def watch(self, course: Course) -> None:
        """Take the frame of a cycle, unless the film leaves it out.

        Raises:
            InputError: MuJoCo cannot render on this machine.
        """
        if self._cycles % self._every == 0:
            frame = self._image.fromarray(course.rover.picture())
            speed = self._every * CYCLE * 1000 / _FRAME_MS
            shown = [
                f"{course.rover.seconds:.1f} s",
                *course.states,
                *([f"{speed:g} times as fast"] if speed > 1 else []),
            ]
            self._draw.Draw(frame).text((8, 6), ", ".join(shown), fill="black")
            self._frames.append(frame)
        self._cycles += 1

    def save(self) -> None:
        """Write the film.

        Raises:
            InputError: the file cannot be written.
        """
        first, *others = self._frames
        try:
            first.save(self._path, save_all=True, append_images=others, duration=_FRAME_MS, loop=0)
        except OSError as error:
            raise InputError(f"the film '{self._path}' cannot be written: {error}") from None
