"""All static checks of a robot project together: PDDL, plots, profiles, components, and their agreement."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from dsc.components.assembly import require_deployed, require_instances
from dsc.components.component import Component
from dsc.components.hooks import contained
from dsc.components.instance_checks import require_whole
from dsc.components.interface import Interface
from dsc.components.wiring import choose_sources, wiring_errors
from dsc.dynamic.knowledge_situation import ACHIEVE, choose
from dsc.dynamic.library import Library
from dsc.errors import Finding, ProgrammingError
from dsc.model.plot import ActionPlot, initial_of
from dsc.model.states import DynamicState
from dsc.profiles import configure
from dsc.skills import SkillSignature
from dsc.text.plot_files import file_of
from dsc.text.profiles import Profile, adapted, load_profile
from dsc.validation import review_plot, validate_plot
from dsc.validation.ignored import without_ignored
from dsc.validation.objects import KnownObjects
from dsc.validation.skill_types import review_types
from knowledge_base.errors import InputError, Place, UnknownNameError, collecting, tolerated
from knowledge_base.language.checking.vocabulary import ROOT_TYPE
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.syntax.expression import Constant, Expression, free_variables
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.pddl.unsaved_texts import readable_text
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema
from planning.analysis.explanation import proven_reasons
from planning.engines.registry import able, installed, refusal
from planning.execution.foresight import require_foresight
from planning.execution.goal_skills import planner_services
from planning.execution.planning_component import PlanningComponent
from planning.execution.shipped_plots import shipped_plots
from planning.model.cancellable_work import WorkLimit, WorkLimitError
from planning.model.domain import PlanningDomain
from planning.problem.construction import check_goal
from planning.problem.derived import derivation
from planning.problem.relevance import numeric_constructs
from planning.robot.bringup import begin, simulated
from planning.robot.bundles import (
    Bundle,
    components_of,
    conversions_of,
    gathered,
    plots_of,
    shipped_by,
    wiring_of,
    with_plots_of,
)
from planning.robot.fact_names import sources_of, wrong_facts
from planning.robot.finding_order import in_order
from planning.robot.initial_values import missing_values
from planning.robot.placed import check_deployment_file
from planning.robot.project_files import (
    NAMES_PLOT,
    READABLE,
    check_files,
    is_deployment,
    is_monitoring,
    is_profile,
    objects_in,
    without_consequences,
)
from planning.robot.scenario_files import check_scenarios
from planning.robot.simulation import Setup, Simulation, components_in, left_in
from planning.robot.soundness import check_implementations, interfaces, run_skills
from planning.robot.targets import bundle_at
from planning.robot.unused import never_true, quoted_names, unused_plots

_PATIENT_SECONDS = 5.0
"""Time limit, in seconds, of the check whether the first goal can be reached."""
_SKIPPED = frozenset({"build", "dist", "node_modules", "site-packages", "__pycache__"})


def check_project(target: str, remote: Sequence[Component] = ()) -> list[Finding]:
    """Return all findings about a target: a project folder, a Python file, a plot file, a bundle's name, MODULE:NAME.

    A mistake prevents no other check: a file that cannot be read is one finding, and the other files are checked. In a
    folder, the files that no bundle uses are checked too.

    Args:
        target: the target.
        remote: the components of `Bundle.remote`, which other programs host. Without them, a name that nothing in the
            target declares is only a warning, unless it resembles a known name.
    """
    path = Path(target)
    if path.is_dir() and not _has_robot(path) and (projects := _projects(path)):
        names = ", ".join(f"`dsc check {project}`" for project in projects)
        error = InputError("the folder is not a project, but contains projects", place=Place(str(path)))
        return [Finding(error, READABLE, names)]
    if path.is_file() and path.suffix != ".py":
        return in_order(without_ignored(_of_file(path), [path]))
    with collecting() as errors:
        bundle = _bundle(target) if not path.is_dir() or _has_robot(path) else None
        unread = any(str(one.place.source).endswith(".pddl") for one in errors if one.place is not None)
        whole = bundle is not None and (bundle.domain is not None or not unread)
        files = list(_sources(path)) if path.is_dir() else []
        robot = None if bundle is None else _Robot(bundle, files, whole=whole, remote=remote)
        findings = [] if robot is None else robot.findings()
        if robot is not None and not errors and all(one.level == "warning" for one in findings):
            findings += robot.pointless()
    findings += [Finding(error, READABLE) for error in errors]
    findings += [found for file in files if is_deployment(file) for found in check_deployment_file(file)]
    if bundle is not None and bundle.remote:
        findings = [_perhaps_remote(one, bundle, asked=bool(remote)) for one in findings]
    if path.is_dir():
        read = {Path(one.place.source or "").resolve() for one in findings if one.place is not None}
        if bundle is not None:
            read |= {file.resolve() for file in map(file_of, bundle.plots) if file is not None}
        findings += check_files(file for file in files if file.resolve() not in read)
    return in_order(without_ignored(findings, files))


def _perhaps_remote(finding: Finding, bundle: Bundle, *, asked: bool) -> Finding:
    """Return a finding as a warning if it concerns a name that a component of another program may declare.

    If these components were `asked`, only their objects are unknown.
    """
    error = finding.error
    if not isinstance(error, UnknownNameError) or error.nearest is not None or error.found in bundle.remote:
        return finding
    if asked:
        learnt = error.message.startswith("there is no object")
        return replace(finding, fix="unless the robot learns of it", level="warning") if learnt else finding
    hosts = " or ".join(f"'{name}'" for name in bundle.remote)
    return replace(
        finding, fix=f"unless {hosts} declares it: `dsc check --hosts` asks the running programs", level="warning"
    )


def _of_file(file: Path) -> list[Finding]:
    """Return the findings about one file that is not Python."""
    if is_deployment(file):
        return check_deployment_file(file)
    return _profile_findings(file) if is_profile(file) else check_files([file])


def _profile_findings(file: Path) -> list[Finding]:
    """Return the findings about a profile, for the robot of the project around it."""
    project = next((folder for folder in file.absolute().parents if _has_robot(folder)), None)
    with collecting() as errors, tolerated():
        profile = load_profile(file)
        bundle = None if project is None else bundle_at(str(project))
        if bundle is not None:
            _Robot(bundle).check_profile(profile)
    return [Finding(error, READABLE) for error in errors]


def _bundle(target: str) -> Bundle | None:
    with tolerated():
        return bundle_at(target)
    return None


def _has_robot(folder: Path) -> bool:
    return (folder / "pyproject.toml").is_file() or (folder / "robot.py").is_file()


def _projects(folder: Path) -> list[Path]:
    """Return the projects directly in a folder."""
    return [one for one in sorted(folder.iterdir()) if one.is_dir() and (one / "pyproject.toml").is_file()]


def _sources(folder: Path) -> Iterator[Path]:
    """Yield the sources of a folder; hidden folders and installed packages are skipped."""
    for file in sorted(folder.rglob("*")):
        inside = file.relative_to(folder).parts
        hidden = any(part.startswith(".") for part in inside) or _SKIPPED.intersection(inside)
        if file.suffix in {".yaml", ".yml", ".pddl", ".py"} and file.is_file() and not hidden:
            yield file


# -- a robot -------------------------------------------------------------------------------------------------


class _Robot:
    """The parts of a bundle that could be made, for the checks of their agreement; used inside `collecting`.

    Args:
        bundle: the bundle.
        files: the sources of the project; empty without a project.
        whole: whether its domain could be read, so that plots and skills can be compared with it.
        remote: the components that other programs host; empty if they are unknown.
    """

    def __init__(
        self, bundle: Bundle, files: Sequence[Path] = (), *, whole: bool = True, remote: Sequence[Component] = ()
    ) -> None:
        self._bundle = bundle
        self._remote = remote
        self._files = files
        self._whole = whole
        self._bundles: tuple[Bundle, ...] = (bundle,)
        with tolerated():
            self._bundles = gathered([bundle])
        self._plots: list[ActionPlot] = [*bundle.plots]
        with tolerated():
            self._plots = plots_of(self._bundles)
        self._simulation: Simulation | None = None
        self._initial: KnowledgeBase | None = None
        self._objects: Mapping[str, str] | None = None
        self._components = self._make_components()
        self._domain = self._merge()

    def _make_components(self, profile: Profile | None = None) -> list[Component] | None:
        """Return the components; `None` if their code fails, so that their absence is not reported again."""
        with tolerated():
            try:
                self._simulation = simulated(self._bundle, Setup(profile=profile))
                with contained(f"the components of '{self._bundle.name}'", (InputError,)):
                    own = () if self._simulation is None else components_in(self._simulation)
                    found = [*components_of(self._bundles), *own, *self._remote]
                if not all(isinstance(one, Component) for one in found):
                    require_instances(found)
                for one in found:
                    require_whole(one)
            except ProgrammingError as error:
                raise InputError(f"programming error in {error}") from error
            return found
        return None

    def _merge(self) -> PlanningDomain | None:
        if not self._whole:
            return None
        with tolerated():
            parts = [one.domain for one in self._bundles if one.domain is not None]
            return PlanningDomain.from_fragments([*parts, *shipped_by(self._components or ())] or [_EMPTY])
        return None

    def findings(self) -> list[Finding]:
        """Return the findings of the validator; other errors go to the list of `collecting`."""
        library = self._library()
        skills, interfaces, exclusive = self._skills(), self._interfaces(), self._exclusive()
        schema = None if self._domain is None else self._domain.schema
        self._initial = world = None if schema is None else self._world(schema)
        self._objects = objects = (
            None if world is None else {**self._objects_nearby(world.schema), **_objects_of(world)}
        )
        found: list[Finding] = []
        for plot in self._plots:
            mistakes = validate_plot(plot, library, schema, skills, interfaces, objects=objects, thorough=True)
            found += mistakes or review_plot(plot, library, skills, exclusive)
        found = without_consequences(found, self._broken_files())
        if self._domain is not None:
            files = sources_of([*(self._components or ()), *filter(None, [self._simulation])])
            found += without_consequences(check_implementations(library, self._domain), self._broken_files())
            self._check_task(world or KnowledgeBase(self._domain.schema))
            found += self._unplannable(self._domain)
            found += () if world is None else missing_values(self._domain, world)
            found += review_types(skills or (), self._domain.schema)
            found += wrong_facts(files, self._domain.schema)
            quoted = quoted_names(map(readable_text, {*files, *(one for one in self._files if one.suffix == ".py")}))
            found += unused_plots(self._plots, self._bundle.main, quoted)
            if world is not None and not self._bundle.remote:  # else other programs may make a fact true
                found += never_true(self._plots, self._domain, world, quoted)
        self._check_components()
        if self._simulation is not None:
            self._check_left(self._simulation)
        if self._components is not None and not self._lacks_remote:
            found += [Finding(error, "wiring") for _, error in wiring_errors([*self._components, planner_services()])]
        return found

    def _skills(self) -> list[SkillSignature] | None:
        if self._components is None or self._lacks_remote:  # the skills of other programs are unknown
            return None
        own = [skill for component in self._components for skill in component.skills().values()]
        return [*own, *run_skills()]

    @property
    def _lacks_remote(self) -> bool:
        """Whether components of other programs are unknown."""
        return bool(self._bundle.remote) and not self._remote

    def _exclusive(self) -> frozenset[str]:
        """Return the skills of the components that execute one skill at a time, as `component.skill`."""
        return frozenset(
            f"{skill.component}.{skill.name}"
            for component in self._components or ()
            for skill in component.skills().values()
            if component.takes_turns(skill)
        )

    def _interfaces(self) -> dict[str, Interface] | None:
        return None if self._components is None or self._lacks_remote else interfaces(self._components)

    def _world(self, schema: Schema) -> KnowledgeBase | None:
        """Return the initial knowledge, or `None` if it has a mistake."""
        with tolerated():
            world = KnowledgeBase(schema)
            try:
                begin(world, self._bundle, self._simulation, "check")
            except ProgrammingError as error:
                raise InputError(f"programming error in {error}") from error
            return world
        return None

    def _check_left(self, simulation: Simulation) -> None:
        """Check the type of what is left, which a run asks for only at its end; at its beginning, the code may fail."""
        with tolerated():
            try:
                left_in(simulation)
            except ProgrammingError as error:
                raise InputError(f"programming error in {error}") from error
            except Exception:  # noqa: BLE001, S110  # the end of a run reports it
                pass

    def _objects_nearby(self, schema: Schema) -> dict[str, str]:
        """Return the objects of the project's problem files."""
        return {name: kind for file in self._files for name, kind in objects_in(file, schema).items()}

    def _check_task(self, world: KnowledgeBase) -> None:
        """Check the goal, the main plot and the foresight."""
        bundle = self._bundle
        with tolerated():
            require_foresight(bundle.foresight, world.schema)
        if bundle.goal is not None:
            with tolerated():
                check_goal(parse_condition(bundle.goal, f"goal of '{bundle.name}'"), world)
        if bundle.main is not None:
            with tolerated():
                self._check_main(bundle.main)

    def _unplannable(self, domain: PlanningDomain) -> Iterator[Finding]:
        """Yield a warning for numbers that actions change, if no installed engine can plan with them."""
        if any(installed(one) and one.races for one in able({"numeric"})):
            return
        goals: list[tuple[Expression, Place | None]] = []
        if self._bundle.goal is not None:
            with suppress(InputError):  # `_check_task` reports it
                goals.append((parse_condition(self._bundle.goal), None))
        for plot in self._plots:
            goals += [(state.goal, plot.place((*path, "goal"))) for _, state, path in plot.walk()
                      if isinstance(state, DynamicState) and state.goal is not None]  # fmt: skip
        found = [(construct, place) for goal, place in goals for construct in numeric_constructs(domain, goal)]
        constructs = {construct.place: (construct, place) for construct, place in found}
        for construct, place in constructs.values():
            outside = construct.place is None or construct.place.source is None
            where = place if outside else construct.place
            error = InputError(f"{replace(construct, place=None)}; {refusal({'numeric'}).who}", place=where)
            yield Finding(error, "engine", level="warning")

    def pointless(self) -> Iterator[Finding]:
        """Yield a warning if the goal with which a run begins holds already, or cannot be reached.

        The parts of the robot must be without mistakes.
        """
        domain, world = self._domain, self._initial
        if domain is None or world is None:
            return
        goal, place = self._first_goal(world)
        if goal is None or free_variables(goal):
            return
        patience = WorkLimit(_PATIENT_SECONDS)
        with suppress(InputError, WorkLimitError):  # errors of the goal are findings already
            if holds(derivation(domain).at(world).condition(goal), world):
                error = InputError("the goal holds in the initial knowledge, so nothing is planned", place=place)
                yield Finding(error, "goal", level="warning")
                return
            if reasons := proven_reasons(domain, world, goal, patience):
                message = f"the goal cannot be reached from the initial knowledge: {'; '.join(reasons)}"
                error = InputError(message, place=place)
                yield Finding(error, "goal", level="warning")

    def _first_goal(self, world: KnowledgeBase) -> tuple[Expression | None, Place | None]:
        """Return the goal that a run plans for before anything else, and its place; `None` without such a goal."""
        if self._bundle.main is None:
            return None if self._bundle.goal is None else parse_condition(self._bundle.goal), None
        plot = next((one for one in self._plots if one.name == self._bundle.main), None)
        first = None if plot is None else plot.states.get(initial_of(plot))
        if plot is None or not isinstance(first, DynamicState) or first.goal is None:
            return None, None
        place = plot.place(("states", initial_of(plot), "goal"))
        if not first.candidates and first.offer is None:
            return first.goal, place
        values = {name: one.default for name, one in plot.parameters.items()}
        values |= {name: one.initial for name, one in plot.variables.items()}
        known = {name: one.value for name, one in values.items() if isinstance(one, Constant)}
        with suppress(InputError):  # a value is known only in a run
            decision = choose(first, plot.name, known, world.overlay(), self._library(), world.version)
            if decision.chosen == ACHIEVE:
                return parse_condition(decision.arguments["goal"]), place
        return None, None

    def _library(self) -> Library:
        own = Library([*self._plots, *shipped_plots()], conversions_of(self._bundles))
        return with_plots_of(own, self._remote)

    def _check_main(self, main: str) -> None:
        plots = {plot.name: plot for plot in self._plots}
        if main not in plots:
            if main in {name for file in self._broken_files() for name in NAMES_PLOT.findall(readable_text(file))}:
                return  # its file has the mistake
            raise UnknownNameError(f"the bundle '{self._bundle.name}' has no plot '{main}'", found=main, valid=plots)
        for name, parameter in plots[main].parameters.items():
            if parameter.required:
                place = plots[main].place(("parameters", name))
                message = f"the main plot '{main}' needs its parameter '{name}', and a run gives it none"
                raise InputError(message, place=place)

    def _check_components(self) -> None:
        if self._components is None:
            return
        with tolerated():
            require_instances(self._components)
            require_deployed(self._components, [PlanningComponent.name])
        with tolerated():
            choose_sources(self._components, wiring_of(self._bundles))
        with tolerated():
            configure(self._components)
        check_scenarios(self._bundle, self._files)
        for file in self._profiles():
            with tolerated():
                profile = load_profile(file)
                self.check_profile(profile)
                if profile.name != file.stem:
                    message = (
                        f"the profile is named '{profile.name}', and its file '{file.stem}': runs use the file's name"
                    )
                    raise InputError(message, place=profile.place(("profile",)), found=profile.name)

    def _profiles(self) -> Iterator[Path]:
        """Yield the files of the bundle's profiles, and of other profiles in the project that no other robot has."""
        own = self._bundle.profiles
        if own is not None and own.is_dir():
            found = sorted(own.glob("*.yaml"))
            yield from (file for file in found if not is_deployment(file) and not is_monitoring(file))
            for file in own.glob("*.yml"):
                with tolerated():
                    raise InputError("the name of a profile's file ends in `.yaml`", place=Place(str(file)))
        for file in self._files:
            if file.parent.name != "profiles" and is_profile(file):
                yield file

    def check_profile(self, profile: Profile) -> None:
        """Check the robot, the components' values and the plots' values of a profile."""
        with tolerated():
            made = self._make_components(profile)
            if made is not None:
                choose_sources(made, wiring_of(self._bundles))
                configure(made, profile)
                self._check_wiring(made, profile)
        with tolerated():
            adapted(self._plots, profile)
            self._check_objects(profile)

    def _check_wiring(self, components: Sequence[Component], profile: Profile) -> None:
        """Raise an error for each wire of a profile that does not fit."""
        for port, error in () if self._lacks_remote else wiring_errors([*components, planner_services()]):
            if port.name in profile.wiring:
                error.place = profile.place(("wiring", port.name))
                with tolerated():
                    raise error

    def _check_objects(self, profile: Profile) -> None:
        """Raise `InputError` for a value of a plot's parameter that is an unknown object, or one of another type."""
        if self._domain is None or self._objects is None:
            return
        known, plots = KnownObjects(self._domain.schema, self._objects), {plot.name: plot for plot in self._plots}
        for plot, values in profile.plots.items():
            for name, value in values.items():
                place, kind = profile.place(("plots", plot, name)), plots[plot].parameters[name].type
                if isinstance(value, str) and (mistake := known.mistake(value, kind, place)) is not None:
                    raise mistake

    def _broken_files(self) -> Iterator[Path]:
        """Yield the plot files that were not read, because they contain an error."""
        read = set(filter(None, map(file_of, self._plots)))
        folders = {file.parent for file in read}
        return (file for folder in folders for file in folder.glob("*.yaml") if file not in read)


_EMPTY = "(define (domain bundles))"


def _objects_of(world: KnowledgeBase) -> dict[str, str]:
    """Return the objects with their types."""
    found = {name: world.type_of(name) for name in world.objects(ROOT_TYPE)}
    return {name: kind for name, kind in found.items() if kind is not None}
