"""Chance without a shared random stream: every draw is a function of the seed and an action's id.

A resumed or replayed run asks with the same action ids and therefore meets the same world, no matter how
many draws were made before.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Sequence

_Option = TypeVar("_Option")


def uniform(seed: int, action_id: str, purpose: str) -> float:
    """A number in [0, 1), the same for the same three arguments on every machine and in every process."""
    text = f"{seed}\x1f{action_id}\x1f{purpose}".encode()
    digest = hashlib.blake2b(text, digest_size=8).digest()
    return (int.from_bytes(digest, "big") >> 11) / 2**53  # 53 bits: a float never rounds up to 1.0


def choose(seed: int, action_id: str, purpose: str, options: Sequence[_Option]) -> _Option:
    """One of `options` (at least one), each as likely as the others."""
    return options[int(uniform(seed, action_id, purpose) * len(options))]
