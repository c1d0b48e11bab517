"""Bundles: components, the plots that use them, and a fragment of a planning domain, distributed together (S0.9).

A component builder bundles components with primitive plots, which use these components. A task expert bundles abstract
plots, which use only other plots. An integrator combines bundles. A Python package declares its bundles in the entry
point group `dsc.bundles`, so a package index serves as the repository ("robot app store").
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, TypedDict, Unpack

from dsc.components.assembly import require_instances
from dsc.components.component import Component
from dsc.components.hooks import contained
from dsc.conversions import Conversion
from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.text.plot_files import load_library
from dsc.text.profiles import Profile
from dsc.validation.subject import addressed_by
from knowledge_base.errors import InputError, Place, UnknownNameError, tolerated
from knowledge_base.facts import Delta
from knowledge_base.language.checking.inputs import require
from knowledge_base.pddl.domain_text import DomainText, parse_domain, read_domain
from knowledge_base.user_objects import described, shown
from planning.execution.foresight import Foresight
from planning.execution.shipped_plots import shipped_plots
from planning.model.domain import PlanningDomain
from planning.robot.simulation import Simulation

GROUP = "dsc.bundles"
"""The entry point group; each entry point refers to a `Bundle`, or to a function that returns one."""


def _none() -> Iterable[Component]:
    return ()


class BundleParts(TypedDict, total=False):
    """The attributes of a `Bundle` except its name."""

    plots: tuple[ActionPlot, ...]
    components: Callable[[], Iterable[Component]]
    domain: PlanningDomain | None
    needs: tuple[str, ...]
    about: str
    main: str | None
    goal: str | None
    knowledge: Delta
    simulation: type[Simulation] | None
    robots: Mapping[str, type[Simulation]]
    foresight: Foresight | None
    failures: Collection[str]
    profiles: Path | None
    conversions: tuple[Conversion[..., Any], ...]
    remote: tuple[str, ...]
    wiring: Mapping[str, str]
    resources: Mapping[str, float] | None


@dataclass(frozen=True, eq=False)  # without slots, for the cached properties
class Bundle:
    """Components, plots and a domain fragment, distributed together.

    A bundle with `main` or `goal` is a robot: `dsc run` runs it.

    Attributes:
        name: the name of the bundle, which other bundles list in `needs`.
        plots: primitive plots, which use components, and abstract plots, which use only plots.
        components: a function that returns new components for each robot program.
        domain: the bundle's planning actions, predicates and types. The components' classes may contain more fragments.
        needs: the names of other bundles whose plots or components this bundle's plots use.
        about: a description of one line.
        main: the plot that a run executes.
        goal: the goal of a run, which the report checks. A run without `main` plans for the goal.
        knowledge: the initial knowledge of the robot.
        simulation: the class of the simulated world. Its components replace real devices.
        robots: further simulated robots for the same plots, by the name that a profile gives under `robot`; each class
            has the components of its robot.
        foresight: simulates each plan before its execution.
        failures: further outcomes of skills that count as failures in reports. By default these are the outcomes that
            plots pass on to their caller, and the failures of all skills, e.g. `timed_out`.
        profiles: a folder of settings profiles (`*.yaml`), which `dsc run --profile` finds by name.
        conversions: the functions that terms of the plots may call, see `dsc.conversion`.
        remote: the names of components that other programs host (`dsc host`). A run connects to them, in real time.
        wiring: the providers of required ports, both as `component.port`, unless a profile names others.
        resources: the capacity of each resource that active components share, see `Robot`.
    """

    name: str
    plots: tuple[ActionPlot, ...] = ()
    components: Callable[[], Iterable[Component]] = _none
    domain: PlanningDomain | None = None
    needs: tuple[str, ...] = ()
    about: str = ""
    main: str | None = None
    goal: str | None = None
    knowledge: Delta = field(default_factory=Delta)
    simulation: type[Simulation] | None = None
    robots: Mapping[str, type[Simulation]] = field(default_factory=dict)
    foresight: Foresight | None = None
    failures: Collection[str] = frozenset()
    profiles: Path | None = None
    conversions: tuple[Conversion[..., Any], ...] = ()
    remote: tuple[str, ...] = ()
    wiring: Mapping[str, str] = field(default_factory=dict)
    resources: Mapping[str, float] | None = None

    def __post_init__(self) -> None:
        if isinstance(self.failures, str):
            raise InputError(f"failures are a set of outcomes, not the text '{self.failures}'")
        if not callable(self.components):
            said = "`components` is a function that returns a list, as in components=lambda: [Arm()]"
            raise InputError(f"{said}, not {shown(self.components)[:60]}")
        if isinstance(self.remote, str):
            raise InputError(f"remote is a tuple of names: remote=('{self.remote}',)", found=self.remote)
        for plot in self.plots:
            require(
                plot, ActionPlot, "the plots of a bundle are ActionPlots, as load_plot and load_library return them"
            )

    @classmethod
    def in_folder(cls, folder: Path | str, *, name: str | None = None, **parts: Unpack[BundleParts]) -> Bundle:
        """Return the bundle of a folder with `plots/*.yaml`, `domain.pddl`, `profiles/*.yaml`, or some of them.

        Args:
            folder: the folder, e.g. `Path(__file__).parent`.
            name: the name of the bundle; by default the name of the folder.
            parts: the other attributes, e.g. `components` and `main`.

        Raises:
            InputError: the folder has neither plots nor a domain, or a file contains an error; the message contains the
                place.
        """
        folder = Path(folder)
        plots, domain = folder / "plots", folder / "domain.pddl"
        if not plots.is_dir() and not domain.is_file():
            raise InputError("a bundle has plots/*.yaml or a domain.pddl", place=Place(str(folder)))
        found: BundleParts = {}
        if plots.is_dir():
            with tolerated():
                found["plots"] = tuple(load_library(plots))
        if domain.is_file():
            with tolerated():
                found["domain"] = PlanningDomain.from_pddl(domain)
        if (profiles := folder / "profiles").is_dir():
            found["profiles"] = profiles
        found.update(parts)
        return cls(name or folder.resolve().name, **found)

    def simulation_for(self, profile: Profile | None) -> type[Simulation] | None:
        """Return the class of the simulated world with the robot of a profile; `None` without a simulation.

        Raises:
            UnknownNameError: the profile names a robot that is not among `robots`.
        """
        name = None if profile is None else profile.robot
        if profile is None or name is None:
            return self.simulation
        if name not in self.robots:
            lacks = f"has no robot '{name}'" if self.robots else "has no robots by name (Bundle.robots)"
            message, place = f"the bundle '{self.name}' {lacks}", profile.place(("robot",))
            raise UnknownNameError(message, place=place, found=name, valid=self.robots)
        return self.robots[name]

    @cached_property
    def planning_domain(self) -> PlanningDomain:
        """The merged planning domain of the bundle and the bundles that it needs; errors as for `domain_of`."""
        return domain_of(gathered([self]))

    @cached_property
    def library(self) -> Library:
        """The plots of the bundle and the bundles that it needs, with all derived tables; errors as for `plots_of`."""
        found = gathered([self])
        return Library([*plots_of(found), *shipped_plots()], conversions_of(found))

    @property
    def primitive(self) -> tuple[str, ...]:
        """The names of the plots that use components."""
        return tuple(plot.name for plot in self.plots if addressed_by(plot))

    @property
    def abstract(self) -> tuple[str, ...]:
        """The names of the plots that use only plots."""
        return tuple(plot.name for plot in self.plots if not addressed_by(plot))

    def to_json(self) -> dict[str, Any]:
        """Return the content of the bundle as JSON data."""
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


class InstalledBundles(dict[str, Bundle]):
    """Bundles of installed packages, by name.

    Attributes:
        errors: by name, the error about a bundle that cannot be loaded; the other bundles are usable nevertheless.
    """

    def __init__(self) -> None:
        super().__init__()
        self.errors: dict[str, InputError] = {}

    def require(self, name: str) -> Bundle:
        """Return the bundle of that name.

        Raises:
            UnknownNameError: there is no such bundle.
            InputError: the bundle cannot be loaded.
        """
        if name in self.errors:
            raise self.errors[name]
        if name not in self:
            raise UnknownNameError(f"there is no bundle '{name}'", found=name, valid=self)
        return self[name]


def installed() -> InstalledBundles:
    """Return the bundles of all installed packages.

    A broken package stops no other: its error is an attribute of the result.
    """
    found = InstalledBundles()
    whose: dict[str, str] = {}
    for point in entry_points(group=GROUP):
        try:
            bundle = _load(point)
        except InputError as error:
            found.errors[point.name] = error
            continue
        name = bundle.name
        if name in whose:
            found.pop(name, None)
            found.errors[name] = InputError(
                f"two bundles are named '{name}': that of {whose[name]} and of {_of(point)}"
            )
        else:
            found[name], whose[name] = bundle, _of(point)
    return found


def gathered(wanted: Iterable[Bundle | str], among: Mapping[str, Bundle] | None = None) -> tuple[Bundle, ...]:
    """Return the wanted bundles and the bundles that they need, directly or indirectly.

    Each bundle appears once, after the bundles that it needs.

    Args:
        wanted: bundles, or names of installed bundles.
        among: the available bundles by name; by default the installed bundles, which are loaded on first use.

    Raises:
        UnknownNameError: a bundle is missing; the message identifies the bundle that needs it.
        InputError: two different bundles have equal names.
    """
    if isinstance(wanted, Bundle | str):
        raise InputError(f"the bundles are a list, e.g. [{getattr(wanted, 'name', wanted)!r}], not one bundle")
    wanted = tuple(wanted)
    given = {one.name: one for one in wanted if isinstance(one, Bundle)}
    found: dict[str, Bundle] = {}
    begun: set[str] = set()

    def there() -> Mapping[str, Bundle]:
        nonlocal among
        among = installed() if among is None else among
        return among

    def add(name: str, whose: str) -> None:
        if name in begun:  # two bundles may need each other
            return
        bundle = given.get(name) or there().get(name)
        if bundle is None and isinstance(among, InstalledBundles) and name in among.errors:
            raise among.errors[name]
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
    """Return the plots of all bundles.

    Raises:
        InputError: two bundles contain different plots with equal names.
    """
    found: dict[str, tuple[ActionPlot, str]] = {}
    for bundle in bundles:
        for plot in bundle.plots:
            other, whose = found.setdefault(plot.name, (plot, bundle.name))
            if other.digest != plot.digest:
                raise InputError(f"the bundles '{whose}' and '{bundle.name}' have different plots '{plot.name}'")
    return [plot for plot, _ in found.values()]


def conversions_of(bundles: Iterable[Bundle]) -> list[Conversion[..., Any]]:
    """Return the conversions of the bundles, without repetitions."""
    return list(dict.fromkeys(one for bundle in bundles for one in bundle.conversions))


def resources_of(bundles: Iterable[Bundle]) -> dict[str, float] | None:
    """Return the capacities of the bundles; `None` if no bundle states any."""
    stated = [bundle.resources for bundle in bundles if bundle.resources is not None]
    return {name: amount for one in stated for name, amount in one.items()} if stated else None


def wiring_of(bundles: Iterable[Bundle]) -> dict[str, str]:
    """Return the wiring of the bundles; a bundle replaces wires of the bundles that it needs."""
    return {port: provider for bundle in bundles for port, provider in bundle.wiring.items()}


def components_of(bundles: Collection[Bundle]) -> list[Component]:
    """Return new components of all bundles.

    Raises:
        InputError: two bundles contain components with equal names.
    """
    found: dict[str, tuple[Component, str]] = {}
    for bundle in bundles:
        own: object = bundle.components()
        if isinstance(own, Component | str) or not isinstance(own, Iterable):
            raise InputError(f"`components` of the bundle '{bundle.name}' returns {shown(own)} instead of a list")
        for component in own:
            if not isinstance(component, Component):
                require_instances([component])
            if component.name in found:
                whose = found[component.name][1]
                both = f"the bundles '{whose}' and '{bundle.name}' both have a component"
                said = both if whose != bundle.name else f"the bundle '{whose}' has two components named"
                raise InputError(f"{said} '{component.name}'", found=component.name)
            found[component.name] = component, bundle.name
    return [component for component, _ in found.values()]


def domain_of(bundles: Collection[Bundle]) -> PlanningDomain:
    """Return the merged planning domain of the bundles.

    Raises:
        InputError: two domain fragments contradict each other.
    """
    parts = [one.domain for one in bundles if one.domain is not None]
    return PlanningDomain.from_fragments(parts or ["(define (domain bundles))"])


def shipped_by(components: Iterable[Component]) -> list[DomainText]:
    """Return the domain fragments of the components, one for each class; also those of components of other programs.

    Raises:
        InputError: a file cannot be read, or does not contain a planning domain.
    """
    fragments = dict.fromkeys((component.domain_fragment(), type(component).__name__) for component in components)
    return [_read(domain, owner) for domain, owner in fragments if domain is not None]


def with_plots_of(library: Library, components: Iterable[Component]) -> Library:
    """Return the library with the plots of components; they implement the actions that no other plot implements."""
    brought = [plot for component in components for plot in component.plots()]
    if not brought:
        return library
    plots = [
        plot.model_copy(update={"implements": None})
        if plot.implements is not None and library.implementing(plot.implements)
        else plot
        for plot in brought
    ]
    return Library([*library, *plots], library.conversions.values())


def _load(point: EntryPoint) -> Bundle:
    try:
        with contained():
            found = point.load()
            bundle = found() if callable(found) else found
    except Exception as error:
        raise InputError(f"the bundle '{point.name}' of {_of(point)} cannot be loaded: {described(error)}") from error
    if not isinstance(bundle, Bundle):
        raise InputError(f"the entry point '{point.name}' of {_of(point)} leads to {shown(bundle)}, not to a Bundle")
    return bundle


def _of(point: EntryPoint) -> str:
    return f"package '{point.dist.name}'" if point.dist is not None else f"'{point.value}'"


def _read(shipped: Path | str, owner: str) -> DomainText:
    return read_domain(shipped) if isinstance(shipped, Path) else parse_domain(shipped, f"{owner}.domain")
