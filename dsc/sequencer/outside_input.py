"""Input from outside of a run: events, changes of knowledge, an operator's settings and wires."""

from __future__ import annotations

from abc import ABC, abstractmethod

from dsc.dynamic.library import Library
from dsc.events import Event
from dsc.messages import FromOutside
from dsc.sequencer import message_checks
from dsc.sequencer.dispatcher import Dispatcher
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from knowledge_base.store import KnowledgeBase


class OutsideInput(ABC):
    """The methods of a sequencer that other programs and threads call; each checks its input first."""

    library: Library
    knowledge: KnowledgeBase
    dispatcher: Dispatcher
    _over: bool

    @abstractmethod
    def _hand_in(self, message: FromOutside, after: float) -> None:
        """Pass a checked message to the run after that number of seconds."""

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
        if self._over:
            raise InputError("the run has ended and receives nothing")
        self._hand_in(message_checks.checked_event(event, self.library, self.knowledge), after)

    def change(self, delta: Delta, author: str, *, after: float = 0.0) -> None:
        """Post a change of knowledge from outside, from any thread.

        Args:
            delta: the change.
            author: the change's author.
            after: as for `post`.

        Raises:
            InputError: the change contradicts the schema; the knowledge is unchanged.
            StoreError: the store cannot be written.
        """
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
            InputError: the value is out of range or violates a relation, or operators may not set the parameter.
            StoreError: the store cannot be written.
        """
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
            InputError: the service does not fit.
            StoreError: the store cannot be written.
        """
        self._hand_in(message_checks.checked_wire(port, to, self.dispatcher.components), after)
