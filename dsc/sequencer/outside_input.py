"""Input from outside of a run: events, changes of knowledge and of plots, an operator's settings and wires."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable
from threading import Lock

from dsc.components.assembly import require_deployed, require_instances
from dsc.components.component import Component
from dsc.components.wiring import name_sources, require_wired
from dsc.dynamic.library import Library
from dsc.engine.plot_changes import ActivePlots
from dsc.events import Event
from dsc.messages import FromOutside, PlotsMessage
from dsc.model.plot import ActionPlot
from dsc.profiles import configure
from dsc.runs.encoding import signature_forms
from dsc.sequencer import message_checks
from dsc.sequencer.dispatcher import Dispatcher
from dsc.validation import raise_findings, validate_library
from knowledge_base.errors import InputError, SchemaError
from knowledge_base.facts import Delta
from knowledge_base.store import KnowledgeBase


class OutsideInput(ABC):
    """The methods of a sequencer that other programs and threads call; each checks its input first."""

    library: Library
    knowledge: KnowledgeBase
    dispatcher: Dispatcher
    _over: bool

    def __init__(self) -> None:
        self.check_plots: Callable[[Library, Collection[Component]], None] = self._require_valid
        self._changes: list[PlotsMessage] = []  # handed in and not taken yet
        self._arriving: dict[str, Component] = {}  # handed in during the run
        self._handing_in = Lock()

    @abstractmethod
    def _hand_in(self, message: FromOutside, after: float) -> None:
        """Pass a checked message to the run after that number of seconds."""

    @abstractmethod
    def _hand_in_components(self, components: Collection[Component]) -> None:
        """Pass checked components to the run."""

    def post(self, event: Event, *, after: float = 0.0) -> None:
        """Post an event from outside, e.g. an operator's `stop`, from any thread.

        Messages of one thread arrive in the order of their calls. A store keeps a delayed event from this call on, or
        from the loop's next iteration on if another thread calls. It keeps an immediate event from its macrostep on.

        Args:
            event: the event's name and attributes.
            after: seconds until the event arrives; until then, the run does not count as a deadlock.

        Raises:
            InputError: only the executive itself fires the event, e.g. `done`, or an attribute is not plain data. The
                error is also raised if the plots that receive the event declare other attributes or types, or if the
                run has ended.
            UnknownNameError: no plot receives the event.
            StoreError: the store cannot be written.
        """
        self._require_running()
        self._hand_in(message_checks.checked_event(event, self.library, self.knowledge), after)

    def change(self, delta: Delta, author: str, *, after: float = 0.0) -> None:
        """Post a change of knowledge from outside, from any thread.

        Args:
            delta: the change.
            author: the change's author.
            after: as for `post`.

        Raises:
            InputError: the change contradicts the schema, or the run has ended; the knowledge is unchanged.
            StoreError: the store cannot be written.
        """
        self._require_running()
        self._hand_in(message_checks.checked_change(delta, author, self.knowledge), after)

    def set_parameter(self, owner: str, name: str, value: object, *, after: float = 0.0) -> None:
        """Post an operator's setting of a parameter, from any thread.

        A component receives the value before its next skill begins. A plot uses the value at later entries that set no
        other value. A store keeps both kinds of settings.

        Args:
            owner: the component, or the plot, that has the parameter.
            name: the parameter's name.
            value: a value within the parameter's range; `None` resets a component's parameter.
            after: as for `post`.

        Raises:
            UnknownNameError: there is no such component or plot, or it declares no such parameter.
            InputError: the value is out of range or violates a relation, operators may not set the parameter, or the
                run has ended.
            StoreError: the store cannot be written.
        """
        self._require_running()
        setting = message_checks.checked_setting(owner, name, value, self.dispatcher.components, self.library)
        self._hand_in(setting, after)

    def wire(self, port: str, to: str | None, *, after: float = 0.0) -> None:
        """Wire a required port to another provider, from any thread (S1.18); wires of active states stay above.

        Args:
            port: the required port, as `component.port`.
            to: the provided port, as `component.port`, or a component; `None` cuts the wire, and pending calls end.
            after: as for `post`.

        Raises:
            UnknownNameError: there is no such component or port.
            InputError: the service does not fit, or the run has ended.
            StoreError: the store cannot be written.
        """
        self._require_running()
        self._hand_in(message_checks.checked_wire(port, to, self.dispatcher.components), after)

    def install(self, plots: ActionPlot | Iterable[ActionPlot] = (), components: Iterable[Component] = ()) -> None:
        """Install plots and components in the run, from any thread (S0.19); later entries may use them.

        All plots and components of the run are checked together as before a run. The run wires the components by
        service, and stops them at its end. A store keeps the plots; a program that resumes the run deploys the
        components itself.

        Args:
            plots: the plots.
            components: the components; the plots that they provide are installed, too.

        Raises:
            SchemaError: the run has a plot or a component of this name.
            PlotError: the plots do not pass the validator; the run is unchanged.
            InputError: a value is not a plot or component, a component lacks a value or a provider, or the run has
                ended; the run is unchanged.
        """
        added = require_instances(components)
        new = message_checks.plots_by_name(plots)
        for plot in (plot for one in added for plot in one.plots()):
            new.setdefault(plot.name, plot)
        with self._handing_in:
            library = self._coming()
            for name in new:
                if name in library:
                    raise SchemaError(f"there is already a plot '{name}': `replace` replaces it", found=name)
            self._require_deployable(added)
            skills = {one.name: signature_forms(one.skills().values()) for one in added}
            self._hand_in_plots(library, PlotsMessage(new, components=skills), added)

    def replace(self, plots: ActionPlot | Iterable[ActionPlot], *, active: ActivePlots = "at_next_entry") -> None:
        """Replace plots of the run by others of the same names, from any thread (S2.8).

        A change with which a running plot cannot continue, e.g. as a parameter has no value, is refused when the run
        takes it; the record `plots` then has the reason. A replaced plot has the defaults of the new plot.

        Args:
            plots: the new plots.
            active: the treatment of running plots, see `ActivePlots`.

        Raises:
            UnknownNameError: the run has no plot of this name.
            PlotError: the plots do not pass the validator; the run is unchanged.
            InputError: a value is not a plot, `active` is unknown, or the run has ended.
        """
        message_checks.require_active(active)
        new = message_checks.plots_by_name(plots)
        with self._handing_in:
            library = self._coming()
            for name in new:
                library.plot(name)
            self._hand_in_plots(library, PlotsMessage(new, active))

    def remove(self, *names: str) -> None:
        """Remove plots from the run, from any thread; running ones end as usual.

        Raises:
            UnknownNameError: the run has no plot of this name.
            PlotError: another plot needs a plot of this name; the run is unchanged.
            InputError: the run has ended.
        """
        with self._handing_in:
            library = self._coming()
            for name in names:
                library.plot(name)
            self._hand_in_plots(library, PlotsMessage(dict.fromkeys(names), "at_next_entry"))

    def _require_deployable(self, added: Collection[Component]) -> None:
        """Raise an error unless components can be deployed in addition to the present ones, whose wires stay."""
        deployed = {**self.dispatcher.components, **self._arriving}
        for one in added:
            if one.name in deployed:
                raise SchemaError(f"there is already a component '{one.name}'", found=one.name)
        configure(added)
        present = [*deployed.values(), *added]
        require_deployed(present)
        name_sources(deployed.values(), deployed.values())
        require_wired(present)
        room = self.dispatcher.activation.room
        if room is not None:
            room.require(added)

    def _require_running(self) -> None:
        if self._over:
            raise InputError("the run has ended and receives nothing")

    def _coming(self) -> Library:
        """Return a copy of the plots after all changes that were handed in."""
        self._require_running()
        library = self.library.copy()
        for message in [*self._changes]:  # the run takes them in its own thread
            library.change(message.plots)
        return library

    def _hand_in_plots(self, library: Library, message: PlotsMessage, added: Collection[Component] = ()) -> None:
        library.change(message.plots)
        self.check_plots(library, [*self._arriving.values(), *added])
        self._arriving.update({one.name: one for one in added})
        self._changes.append(message)
        self._hand_in_components(added)
        self._hand_in(message, 0.0)

    def _require_valid(self, library: Library, added: Collection[Component]) -> None:
        """Raise `PlotError` if plots do not fit each other, the knowledge, or the deployed and the added components."""
        present = {**self.dispatcher.components, **{one.name: one for one in added}}
        skills = self.dispatcher.skills()
        if skills is not None:
            skills = [skill for one in present.values() for skill in one.skills().values()]
        declared = {name: one.interface() for name, one in present.items()}
        raise_findings(validate_library(library, self.knowledge.schema, skills, declared))
