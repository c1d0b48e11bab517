"""The planning engines there are, what each can do, and which of them suit a problem.

Nothing here imports an engine or unified-planning: whether one is installed is looked up in the metadata of
the packages, so that asking costs next to nothing.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

from knowledge_base.errors import UnknownNameError
from planning.plan import NobodyCan

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable

    from planning.strips import Problem

DISTRIBUTION = "dynamic-state-charts"

WISHES = frozenset({"costs"})
"""Features that an engine may ignore: its plan is valid all the same, only not the cheapest."""

AT_ONCE = 2
"""How many engines race at most (CONTRACTS.md, Planning): there are robots with two cores."""


@dataclass(frozen=True, slots=True)
class Engine:
    """A planning engine as it is used here.

    Attributes:
        name: what it is called on the command line and in outcomes.
        driver: the module of `planning.engines` that runs it, inside the worker process.
        made_by: what the driver makes it of: `module:class` of a unified-planning engine, or a configuration.
        package: the distribution it comes in.
        at_least: the oldest version of that.
        licence: the engine's own, which may be another than its package's.
        features: what it can do beyond STRIPS, out of `planning.strips.FEATURES`.
        program: what has to be on the path besides.
        optimal: whether its plans are the cheapest there are.
        anytime: whether it goes on to look for better plans.
        proves: whether it ends when there is no plan.
        deterministic: whether the same problem gets the same plan on every run.
        races: whether it is chosen by itself, or only by name.
        most_actions: with more ground actions than this it is no use beside an engine that has no such bound.
    """

    name: str
    driver: str
    made_by: str
    package: str
    at_least: str
    licence: str
    features: frozenset[str] = frozenset()
    program: str = ""
    optimal: bool = False
    anytime: bool = False
    proves: bool = True
    deterministic: bool = True
    races: bool = True
    most_actions: int | None = None

    @property
    def version(self) -> str | None:
        """The installed version of its package; `None` if there is none."""
        return _version(self.package)

    def lacks(self) -> str:
        """What to do before it can be used; empty if it can be used now."""
        steps = []
        if self.version is None:
            steps.append(f"pip install '{self.package}>={self.at_least}'")
        if self.program and shutil.which(self.program) is None:
            steps.append(f"put '{self.program}' on the path")
        return ", ".join(steps)

    def can_do(self, features: Collection[str]) -> bool:
        """Whether it can plan with these features; `WISHES` are not asked for."""
        return self.features.issuperset(frozenset(features) - WISHES)


@cache
def _version(package: str) -> str | None:
    """Looked up once: it takes a millisecond, and is asked for each engine whenever a race begins."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


# In the order of preference. Fast Downward gets its input ready made (see the driver), so that it is ahead of
# pyperplan on the smallest problem, too; pyperplan greedily takes seconds from about 1,000 ground actions on.
ENGINES = (
    Engine(
        "fast-downward", "fast_downward", "first, then better", "up-fast-downward", "1.0", "GPL-3.0",
        features=frozenset({"costs"}), anytime=True,
    ),
    Engine(
        "pyperplan", "pyperplan", "greedy, h_FF", "pyperplan", "2.1", "GPL-3.0", most_actions=1500,
    ),
    Engine(
        "enhsp", "up", "up_enhsp.enhsp_planner:ENHSPEngine", "up-enhsp", "0.1.1", "GPL-3.0",
        features=frozenset({"numeric", "costs"}), program="java", most_actions=300,
    ),
    Engine(
        "aries", "up", "up_aries.solver:Aries", "up-aries", "0.5", "MIT",
        features=frozenset({"durations"}), proves=False, deterministic=False, most_actions=300,
    ),
    Engine(
        "fast-downward-opt", "fast_downward", "optimal", "up-fast-downward", "1.0", "GPL-3.0",
        features=frozenset({"costs"}), optimal=True, races=False,
    ),
    Engine(
        "enhsp-opt", "up", "up_enhsp.enhsp_planner:ENHSPOptEngine", "up-enhsp", "0.1.1", "GPL-3.0",
        features=frozenset({"numeric", "costs"}), program="java", optimal=True, races=False,
    ),
)  # fmt: skip


def engine(name: str) -> Engine:
    """The engine of that name.

    Raises:
        UnknownNameError: there is none.
    """
    for one in ENGINES:
        if one.name == name:
            return one
    raise UnknownNameError(f"there is no engine '{name}'", found=name, valid=[one.name for one in ENGINES])


def able(features: Collection[str], engines: Iterable[Engine] = ENGINES) -> list[Engine]:
    """The engines that can plan with these features, those that also grant the wishes first."""
    wishes = WISHES.intersection(features)
    suited = [one for one in engines if one.can_do(features)]
    return sorted(suited, key=lambda one: not wishes <= one.features)  # stable: else as preferred


def installed(one: Engine) -> bool:
    """Whether it can be used now."""
    return not one.lacks()


def can_time(name: str) -> bool:
    """Whether the engine of that name, if there is one, plans with durations."""
    return any(one.name == name and "durations" in one.features for one in ENGINES)


def timing() -> list[Engine]:
    """The installed engines that plan with durations and are chosen by themselves."""
    return [one for one in able({"durations"}) if one.races and installed(one)]


def in_concert() -> str:
    """Who could find a plan with several actions at a time, and how to get him, as text."""
    return "engines that could do several: " + ", ".join(map(described, able({"durations"})))


def nobody(problem: Problem, engine: str = "") -> NobodyCan:
    """The outcome where no engine, or not the only one that may be asked, can do what the problem needs."""
    could = tuple((one.name, one.lacks()) for one in able(problem.features) if one.races)
    return NobodyCan(engine, tuple(sorted(problem.features - WISHES)), could)


def cannot(name: str, problem: Problem) -> bool:
    """Whether the engine of that name is known not to do what the problem needs."""
    return any(one.name == name and not one.can_do(problem.features) for one in ENGINES)


def described(one: Engine) -> str:
    """The engine, and what to do before it can be used."""
    lacks = one.lacks()
    return f"{one.name} ({lacks})" if lacks else one.name


def chosen(problem: Problem, *, usable: Callable[[Engine], bool] = installed) -> list[Engine]:
    """The engines that shall race for a plan, at most `AT_ONCE`; none if none that can is installed.

    Nor is one chosen for a problem with durations that is too large for it: one action at a time is quicker then.
    """
    racing = [one for one in able(problem.features) if one.races and usable(one)]
    size = len(problem.actions)
    fitting = [one for one in racing if one.most_actions is None or size <= one.most_actions]
    return (fitting or ([] if "durations" in problem.features else racing))[:AT_ONCE]
