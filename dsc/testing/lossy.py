"""Transport with the faults of a bad network, drawn from a seed."""

from __future__ import annotations

import asyncio
import hashlib
from collections import Counter

from dsc.chance import uniform
from dsc.components.transport import LocalTransport


class LossyTransport(LocalTransport):
    """Loses, doubles, delays and so reorders frames; the same seed gives the same faults in simulated time.

    Args:
        seed: of all draws.
        loss: chance that a frame is lost.
        double: chance that one arrives twice.
        delay: upper bound of a frame's delay in seconds.
    """

    def __init__(self, seed: int, *, loss: float = 0.2, double: float = 0.2, delay: float = 0.1) -> None:
        super().__init__()
        self._seed = seed
        self._loss = loss
        self._double = double
        self._delay = delay
        self._sent: Counter[str] = Counter()

    def send(self, sender: str, to: str, frame: bytes) -> None:
        """Send a frame with a separate draw of its faults: the same frame sent again has other faults."""
        name = hashlib.blake2b(f"{sender} {to} ".encode() + frame, digest_size=8).hexdigest()
        self._sent[name] += 1
        subject = f"{name} {self._sent[name]}"
        if uniform(self._seed, subject, "loss") < self._loss:
            return
        doubled = uniform(self._seed, subject, "double") < self._double
        for copy in range(1 + doubled):
            late = self._delay * uniform(self._seed, subject, f"delay {copy}")
            asyncio.get_running_loop().call_later(late, self.deliver, sender, to, frame)
