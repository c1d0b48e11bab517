"""The registry of planning engines: their features, and the choice of engines for a problem.

This module imports neither an engine nor unified-planning. Package metadata show whether an engine is installed, so a
query takes little time.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from knowledge_base.errors import InputError, UnknownNameError
from planning.model.plan import Unsupported
from planning.model.problem import Problem

WISHES = frozenset({"costs"})
"""Features that an engine may ignore; the plan is then still valid, but may be expensive."""

PARALLEL_ENGINES = 2
"""The maximum number of engines in a race (CONTRACTS.md, Planning), because some robots have only two cores."""


@dataclass(frozen=True, slots=True)
class Engine:
    """A planning engine and its driver.

    Attributes:
        name: the name on the command line and in outcomes.
        driver: the module of `planning.engines` that runs the engine inside the worker process.
        made_by: the argument of the driver: `module:class` of a unified-planning engine, or a configuration.
        package: the distribution that contains the engine.
        at_least: the lower bound of the package's version.
        licence: the licence of the engine, which may differ from the licence of the package.
        features: the supported features beyond STRIPS, a subset of `planning.model.problem.FEATURES`.
        program: a program that must also be on the path; empty if none is needed.
        optimal: whether plans have the lowest cost.
        anytime: whether the engine continues to search for better plans.
        proves: whether the search ends if the problem has no plan.
        deterministic: whether equal problems have equal plans in every run.
        races: whether a race may choose the engine; otherwise only the user selects the engine by name.
        extra: the extra of this package that installs the engine; empty if `package` alone installs it.
        made_for: a race chooses the engine only for a problem with one of these features; empty for any problem.
        most_actions: the largest number of ground actions for which a race chooses the engine; `None` for no limit.
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
    extra: str = ""
    made_for: frozenset[str] = frozenset()
    most_actions: int | None = None

    @property
    def version(self) -> str | None:
        """The installed version of the package; `None` if the package is not installed."""
        return package_version(self.package)

    def lacks(self) -> str:
        """Return the steps that make the engine usable; empty if the engine is usable."""
        steps = []
        if self.version is None:
            needed = f"dynamic-state-charts[{self.extra}]" if self.extra else f"{self.package}>={self.at_least}"
            steps.append(f"pip install '{needed}'")
        if self.program and shutil.which(self.program) is None:
            steps.append(f"put '{self.program}' on the path")
        return ", ".join(steps)

    def can_do(self, features: Collection[str]) -> bool:
        """Return whether the engine supports these features, except those in `WISHES`."""
        return self.features.issuperset(frozenset(features) - WISHES)


@cache
def package_version(package: str) -> str | None:
    """Return the installed version; cached, since a lookup takes a millisecond and each race checks every engine."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


_NUMBERS_AND_TIME = frozenset({"numeric", "durations"})

# The order is the order of preference. Fast Downward runs without its translator (see the driver), so it is faster than
# pyperplan even on the smallest problem. Greedy pyperplan takes seconds from about 1,000 ground actions upwards.
ENGINES = (
    Engine(
        "fast-downward", "fast_downward", "first, then better", "up-fast-downward", "1.0", "GPL-3.0",
        features=frozenset({"costs"}), anytime=True,
    ),
    Engine(
        "pyperplan", "pyperplan", "greedy, h_FF", "pyperplan", "2.1", "GPL-3.0", most_actions=1500,
    ),
    Engine(
        "kairos", "kairos", "", "kairos-planner", "1.0.6", "Apache-2.0",
        features=_NUMBERS_AND_TIME, extra="numbers", made_for=_NUMBERS_AND_TIME, most_actions=3000,
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
    """Return the engine with this name.

    Raises:
        UnknownNameError: no engine has this name.
    """
    for one in ENGINES:
        if one.name == name:
            return one
    raise UnknownNameError(f"there is no engine '{name}'", found=name, valid=[one.name for one in ENGINES])


def able(features: Collection[str]) -> list[Engine]:
    """Return the engines that support these features; engines that also support the wishes come first."""
    wishes = WISHES.intersection(features)
    suited = [one for one in ENGINES if one.can_do(features)]
    return sorted(suited, key=lambda one: not wishes <= one.features)  # stable: otherwise in the order of preference


def installed(one: Engine) -> bool:
    """Return whether the engine is usable without further steps."""
    return not one.lacks()


def can_time(name: str) -> bool:
    """Return whether the registry has an engine with this name that supports durations."""
    return any(one.name == name and "durations" in one.features for one in ENGINES)


def timing() -> list[Engine]:
    """Return the installed engines that support durations and take part in races."""
    return [one for one in able({"durations"}) if one.races and installed(one)]


def in_concert() -> str:
    """Return, as text, the engines that support concurrent actions, with the steps that make them usable."""
    return "engines that could do several: " + ", ".join(map(described, able({"durations"})))


def refusal(features: Collection[str], engine: str = "") -> Unsupported:
    """Return the outcome for a problem with these features, which no permitted engine supports."""
    could = tuple((one.name, one.lacks()) for one in able(features) if one.races)
    return Unsupported(engine, tuple(sorted(frozenset(features) - WISHES)), could)


def cannot(name: str, problem: Problem) -> bool:
    """Return whether the engine with this name lacks a feature of the problem; `False` for an unknown engine."""
    return any(one.name == name and not one.can_do(problem.features) for one in ENGINES)


def described(one: Engine) -> str:
    """Return the name of the engine, with the steps that make the engine usable."""
    lacks = one.lacks()
    return f"{one.name} ({lacks})" if lacks else one.name


def chosen(problem: Problem, *, usable: Callable[[Engine], bool] = installed) -> list[Engine]:
    """Return at most `PARALLEL_ENGINES` engines for a race; empty if no usable engine supports the problem.

    The result is also empty for a temporal problem that is too large for every engine. The problem with one action at
    a time is then solved faster.
    """
    racing = [one for one in _racing(problem) if usable(one)]
    size = len(problem.actions)
    fitting = [one for one in racing if one.most_actions is None or size <= one.most_actions]
    return (fitting or ([] if "durations" in problem.features else racing))[:PARALLEL_ENGINES]


def _racing(problem: Problem) -> list[Engine]:
    """Return the engines that a race may choose for the problem, in the order of preference."""
    features = problem.features
    suited = [one for one in able(features) if one.races and (not one.made_for or one.made_for & features)]
    return sorted(suited, key=lambda one: not one.made_for)  # stable


def repeatable(problem: Problem, *, usable: Callable[[Engine], bool] = installed) -> list[Engine]:
    """Return the engine for a run in simulated time, which must be repeatable; empty if no usable engine suits.

    The engine is pyperplan, which every installation has, or else the first deterministic engine.
    """
    suited = [one for one in _racing(problem) if one.deterministic and usable(one)]
    return sorted(suited, key=lambda one: one.name != "pyperplan")[:1]


def only(name: str) -> Callable[[Problem], Sequence[Engine]]:
    """Return a choice of one engine, for `PlannerRace`; the choice is empty for problems that it does not support.

    Raises:
        UnknownNameError: no engine has this name.
        InputError: the engine is not installed.
    """
    named = engine(name)
    if lacks := named.lacks():
        raise InputError(f"the engine '{name}' is not installed: {lacks}")
    return lambda problem: [named] if named.can_do(problem.features) else []
