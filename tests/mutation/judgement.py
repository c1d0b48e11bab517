"""Survivors that are accepted and kinds of mutants that are excluded, each with its reason."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

ACCEPTED = Path(__file__).with_name("accepted.toml")
EXCLUDED = Path(__file__).with_name("excluded.toml")


@dataclass(frozen=True)
class Accepted:
    """A mutation that survives for a reason. Function and text identify it, so its line may move.

    Attributes:
        function: module, class and function, joined by dots.
        change: removed lines after `- `, then added lines after `+ `, without indentation.
        reason: why no test can or should notice.
    """

    function: str
    change: str
    reason: str


@dataclass(frozen=True)
class Excluded:
    """A kind of mutation that no test has to notice: `pattern` matches its whole change."""

    pattern: str
    reason: str


def read_accepted() -> dict[tuple[str, str], str]:
    """The reason of each accepted survivor, by function and change."""
    entries = [Accepted(**said) for said in tomllib.loads(ACCEPTED.read_text())["accepted"]]
    return {(one.function, one.change.strip()): one.reason for one in entries}


def read_excluded() -> list[Excluded]:
    """Kinds of mutants that do not count."""
    return [Excluded(**said) for said in tomllib.loads(EXCLUDED.read_text())["excluded"]]


def exclusion(change: str, kinds: list[Excluded]) -> str | None:
    """Return the reason for which a change is excluded, or None."""
    return next((kind.reason for kind in kinds if re.fullmatch(kind.pattern, change)), None)
