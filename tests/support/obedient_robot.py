"""A robot for any domain: each planning action is one skill call, which a script may let go wrong."""

from dsc import ActionPlot, Component, Outcome, SkillCall, skill
from knowledge_base import Delta
from planning import PlanStep

FAILED = "failed"
"""What a script says when the call ends in the outcome `failed` and changes nothing."""


class Failed(Outcome): ...


class Did(Outcome): ...


class ObedientRobot(Component):
    """Does what it is told.

    Args:
        domain: what its steps do.
        script: for steps as text, one after the other what their calls observe instead: a `Delta`, or `FAILED`.
        failing_calls: the calls that fail, counted from 1.
        seconds: how long a call takes.
        until: an event that a call waits for besides.
    """

    name = "robot"

    def __init__(self, domain, script=None, failing_calls=(), seconds=1.0, until=None):
        super().__init__()
        self.domain = domain  # type: ignore[misc]
        self.script = {step: list(answers) for step, answers in (script or {}).items()}
        self.failing_calls = failing_calls
        self.seconds = seconds
        self.until = until
        self.done = []
        self.knowledge = None

    @skill
    async def act(
        self, call: SkillCall, way: str, action: str, one: str = "", two: str = "", three: str = ""
    ) -> Did | Failed:
        """One planning action, done in one way."""
        await call.clock.sleep(self.seconds)
        if self.until is not None:
            await self.until.wait()
        step = PlanStep(action, tuple(filter(None, (one, two, three))))
        self.done.append(f"{step}" if way == action else f"{way}: {step}")
        answers = self.script.get(self.done[-1], [])
        if len(self.done) in self.failing_calls:
            return Failed()
        observed = answers.pop(0) if answers else self.domain.effects(step, self.knowledge)
        return Failed() if observed == FAILED else Did(observed=observed or Delta())


def plots(domain, ways=None):
    """A plot for each planning action; of those named in `ways` one for each of these names."""
    return [
        plot(action, way) for action in domain.actions.values() for way in (ways or {}).get(action.name, [action.name])
    ]


def plot(action, way):
    arguments = dict(zip(("one", "two", "three"), (f"?{p.name}" for p in action.parameters), strict=False))
    return ActionPlot.model_validate({
        "plot": way, "implements": action.name, "emits": {"failed": {}},
        "parameters": {p.name: p.types[0] if p.types else "object" for p in action.parameters},
        "states": {
            "act": {
                "entry": {"trigger": "robot.act", "with": {"way": way, "action": action.name, **arguments}},
                "on": {"did": "acted", "failed": {"to": "ended", "emit": "failed"}},
            },
            "acted": {"final": True}, "ended": {"final": True},
        },
    })  # fmt: skip
