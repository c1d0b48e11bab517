"""The shortest macrostep: the outermost plot alone moves to its next configuration, and nothing else happens.

Most steps of most charts are such steps. What they do was worked out once; what is left is a look-up.
"""

from __future__ import annotations

from dsc.engine.choice import Choice, Question
from dsc.engine.reaction import Reaction
from dsc.engine.situation import Situation
from dsc.engine.state import NOTHING, FrameState, MachineState, at_rest
from dsc.engine.steps import NO_CHANGE, Microstep, Step
from dsc.events import Event
from knowledge_base.errors import InputError

_new = tuple.__new__
"""Makes named tuples; their constructors take as long again, to put keywords and defaults into their places."""


def move(state: MachineState, root: FrameState, event: Event, situation: Situation) -> Step | None:
    """The step, if it is known and as short as that; `None` says that it has to be worked out."""
    before = root.configuration
    known: Step | None = before.steps.get(event.name)
    if known is not None and known.event is event and before.bare is state:
        return known
    choice: Choice | None = before.choices.get(event.name)
    if isinstance(choice, Question):
        choice = _answered(choice, root, event, situation)
    if not isinstance(choice, Reaction) or not choice.still or root.children:
        return None
    following = choice.following
    if before.bare is state:
        after = following.bare or at_rest(root._replace(configuration=following), state.serials)
    else:
        serial, compiled, _, variables, activations, children, kept = root
        frame = _new(FrameState, (serial, compiled, following, variables, activations, children, kept))
        after = _new(MachineState, (frame, state.serials, False))
    micro = _new(Microstep, (event, choice.taken, choice.exited, choice.entered, ()))
    step = _new(Step, (after, event, True, (micro,), (), NO_CHANGE, (), (), (), NOTHING))
    if before.bare is state and before.choices[event.name] is choice:
        before.steps[event.name] = step
    return step


def _answered(question: Question, root: FrameState, event: Event, situation: Situation) -> Choice | None:
    bindings = {**root.variables, **event.bindings()} if event.attributes else root.variables
    choice: Choice = question
    while isinstance(choice, Question):
        try:
            choice = choice.follow(situation.holds(choice.condition, bindings))
        except InputError:  # to be reported by the full macrostep, which asks again
            return None
    return choice
