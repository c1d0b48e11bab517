"""A transport in memory that counts its frames."""

from __future__ import annotations

from dsc.wire.endpoint import LocalTransport


class CountingTransport(LocalTransport):
    def __init__(self):
        super().__init__()
        self.frames = 0

    def deliver(self, sender, to, frame):
        self.frames += 1
        super().deliver(sender, to, frame)
