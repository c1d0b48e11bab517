"""Bundles: components, the plots that use them, and a part of a planning domain, handed on as one (S0.9).

A component builder bundles components with the primitive plots that know how to use them; a task expert bundles
abstract plots, which use plots alone; an integrator puts bundles together. The repository ("robot app store") is that
of Python packages: an installed one names its bundles under the entry point group `dsc.bundles`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from dsc.components.component import Component
from dsc.components.hooks import contained
from dsc.model.plot import ActionPlot
from dsc.text.plot_files import load_library
from dsc.validation.deployment import addressed_by
from knowledge_base.errors import InputError, Place, UnknownNameError, described
from knowledge_base.language.inputs import shown
from knowledge_base.pddl.domain_text import DomainText
from planning.domain import PlanningDomain
from planning.fragments import shipped_by

GROUP = "dsc.bundles"
"""Of the entry points; each leads to a `Bundle`, or to a function that makes one."""


def _none() -> Iterable[Component]:
    return ()


@dataclass(frozen=True, slots=True)
class Bundle:
    """What belongs together.

    Attributes:
        name: by which others say that they need it.
        plots: primitive ones, which use components, and abstract ones, which use plots alone.
        components: makes them, new ones for each program.
        domain: the planning actions, predicates and types it adds; components may bring more.
        needs: names of bundles whose plots or components its own plots use.
        about: one line for people.
    """

    name: str
    plots: tuple[ActionPlot, ...] = ()
    components: Callable[[], Iterable[Component]] = _none
    domain: PlanningDomain | None = None
    needs: tuple[str, ...] = ()
    about: str = ""

    @classmethod
    def in_folder(
        cls,
        folder: Path | str,
        *,
        name: str | None = None,
        components: Callable[[], Iterable[Component]] = _none,
        needs: Iterable[str] = (),
        about: str = "",
    ) -> Bundle:
        """The bundle of what a folder has: `plots/*.yaml` and `domain.pddl`, either of which may be missing.

        Args:
            folder: e.g. `Path(__file__).parent`.
            name: of the bundle; that of the folder if left out.
            components: as the attribute.
            needs: as the attribute.
            about: as the attribute.

        Raises:
            InputError: there is neither, or a file contains a mistake; it says where.
        """
        folder = Path(folder)
        plots, domain = folder / "plots", folder / "domain.pddl"
        if not plots.is_dir() and not domain.is_file():
            raise InputError("a bundle has plots/*.yaml or a domain.pddl", place=Place(str(folder)))
        return cls(
            name or folder.resolve().name,
            tuple(load_library(plots)) if plots.is_dir() else (),
            components,
            PlanningDomain.from_pddl(domain) if domain.is_file() else None,
            tuple(needs),
            about,
        )

    @property
    def primitive(self) -> tuple[str, ...]:
        """Names of the plots that use components."""
        return tuple(plot.name for plot in self.plots if addressed_by(plot))

    @property
    def abstract(self) -> tuple[str, ...]:
        """Names of the plots that use plots alone."""
        return tuple(plot.name for plot in self.plots if not addressed_by(plot))

    def to_json(self) -> dict[str, Any]:
        """What it has, as plain data."""
        components = tuple(self.components())
        own = [] if self.domain is None else [self.domain]
        fragments: list[PlanningDomain | DomainText] = [*own, *shipped_by(components)]
        return {
            "name": self.name,
            "about": self.about,
            "needs": list(self.needs),
            "components": {one.name: sorted(one.skills()) for one in components},
            "primitive": list(self.primitive),
            "abstract": list(self.abstract),
            "actions": sorted(PlanningDomain.from_fragments(fragments).actions) if fragments else [],
        }


def installed() -> dict[str, Bundle]:
    """The bundles of all installed packages, by name.

    Raises:
        InputError: an entry point leads to no bundle, or two bundles have one name; it says whose.
    """
    found: dict[str, Bundle] = {}
    whose: dict[str, str] = {}
    for point in entry_points(group=GROUP):
        bundle = _loaded(point)
        if bundle.name in found:
            raise InputError(f"two bundles are named '{bundle.name}': that of {whose[bundle.name]} and of {_of(point)}")
        found[bundle.name], whose[bundle.name] = bundle, _of(point)
    return found


def gathered(wanted: Iterable[Bundle | str], among: Mapping[str, Bundle] | None = None) -> tuple[Bundle, ...]:
    """The bundles with all that they need, each once, what is needed first.

    Args:
        wanted: bundles, or names of installed ones.
        among: the bundles there are besides, by name; the installed ones if left out, which are loaded when needed.

    Raises:
        UnknownNameError: one is not there; it says who needs it.
        InputError: two different ones have one name.
    """
    wanted = tuple(wanted)
    given = {one.name: one for one in wanted if isinstance(one, Bundle)}
    found: dict[str, Bundle] = {}
    begun: set[str] = set()

    def there() -> Mapping[str, Bundle]:
        nonlocal among
        among = installed() if among is None else among
        return among

    def add(name: str, whose: str) -> None:
        if name in begun:  # bundles may need each other
            return
        bundle = given.get(name) or there().get(name)
        if bundle is None:
            raise UnknownNameError(f"there is no bundle '{name}'{whose}", found=name, valid=[*given, *there()])
        begun.add(name)
        for needed in bundle.needs:
            add(needed, f", which '{name}' needs")
        found[name] = bundle

    for one in wanted:
        if isinstance(one, Bundle) and given[one.name] is not one:
            raise InputError(f"two bundles are named '{one.name}'", found=one.name)
        if not isinstance(one, Bundle | str):
            raise InputError(f"a bundle is a Bundle or the name of an installed one, not {shown(one)}")
        add(one if isinstance(one, str) else one.name, "")
    return tuple(found.values())


def plots_of(bundles: Collection[Bundle]) -> list[ActionPlot]:
    """All their plots; raises `InputError` if two bundles have different ones of one name."""
    found: dict[str, tuple[ActionPlot, str]] = {}
    for bundle in bundles:
        for plot in bundle.plots:
            other, whose = found.setdefault(plot.name, (plot, bundle.name))
            if other.digest != plot.digest:
                raise InputError(f"the bundles '{whose}' and '{bundle.name}' have different plots '{plot.name}'")
    return [plot for plot, _ in found.values()]


def components_of(bundles: Collection[Bundle]) -> list[Component]:
    """New ones of all of them; raises `InputError` if two bundles have components of one name."""
    found: dict[str, tuple[Component, str]] = {}
    for bundle in bundles:
        for component in bundle.components():
            if component.name in found:
                whose = found[component.name][1]
                raise InputError(f"the bundles '{whose}' and '{bundle.name}' both have a component '{component.name}'")
            found[component.name] = component, bundle.name
    return [component for component, _ in found.values()]


def domain_of(bundles: Collection[Bundle]) -> PlanningDomain:
    """What they say together; raises `InputError` if two contradict each other."""
    parts = [one.domain for one in bundles if one.domain is not None]
    return PlanningDomain.from_fragments(parts or ["(define (domain bundles))"])


def _loaded(point: EntryPoint) -> Bundle:
    try:
        with contained():
            found = point.load()
            bundle = found() if callable(found) else found
    except Exception as error:
        raise InputError(f"the bundle '{point.name}' of {_of(point)} cannot be loaded: {described(error)}") from error
    if not isinstance(bundle, Bundle):
        raise InputError(f"the entry point '{point.name}' of {_of(point)} leads to {shown(bundle)}, which is no Bundle")
    return bundle


def _of(point: EntryPoint) -> str:
    return f"package '{point.dist.name}'" if point.dist is not None else f"'{point.value}'"
