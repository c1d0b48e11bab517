"""A transport that does everything a bad network does, from a seed."""

from __future__ import annotations

import asyncio
import random

from dsc.components.transport import LocalTransport


class LossyTransport(LocalTransport):
    """Loses, doubles, delays and so reorders frames, the same with the same seed in simulated time.

    Args:
        seed: of the frames' fates.
        loss: chance that a frame is lost.
        double: chance that one arrives twice.
        delay: seconds that one takes at most.
    """

    def __init__(self, seed: int, *, loss: float = 0.2, double: float = 0.2, delay: float = 0.1) -> None:
        super().__init__()
        self._random = random.Random(seed)  # noqa: S311  # fates, no secrets
        self._loss = loss
        self._double = double
        self._delay = delay

    def send(self, sender: str, to: str, frame: bytes) -> None:
        """Let the frame meet its fate."""
        if self._random.random() < self._loss:
            return
        for _ in range(1 + (self._random.random() < self._double)):
            late = self._random.uniform(0, self._delay)
            asyncio.get_running_loop().call_later(late, self.deliver, sender, to, frame)
