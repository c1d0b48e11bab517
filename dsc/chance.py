"""Random draws without a shared random stream: each draw is a function of the seed and an action's id.

A resumed or replayed run draws with the same action ids. So its simulated world behaves identically, regardless of the
number of earlier draws.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Sequence

_Option = TypeVar("_Option")


def uniform(seed: int, action_id: str, purpose: str) -> float:
    """Return a number in [0, 1), equal for equal arguments on every machine and in every process.

    The run in an action id of real time has no influence, so that equal runs draw equally.
    """
    text = f"{seed}\x1f{action_id.rpartition('/')[2]}\x1f{purpose}".encode()
    digest = hashlib.blake2b(text, digest_size=8).digest()
    return (int.from_bytes(digest, "big") >> 11) / 2**53  # 53 bits: a float never rounds up to 1.0


def choose(seed: int, action_id: str, purpose: str, options: Sequence[_Option]) -> _Option:
    """Return one of `options` (at least one); all options are equally probable."""
    return options[int(uniform(seed, action_id, purpose) * len(options))]
