"""Charts at random with a robot section, and the values of their sensors."""

from __future__ import annotations

import random

from dsc.model.plot import ActionPlot

GUARDS = (
    "(> ?light 0.5)", "(<= ?light 0.3)", "(= ?bumper true)", "(> ?steps 3)", "(in-state a1)", "(in-state b0)",
    "(and (in-state a0) (< ?wheel 1))", "(or (= ?lamp true) (> ?gear 2))", "(> ?light ?edge)", "(< (/ 1 ?steps) 0.5)",
    "(= ?blink true)", "(= ?hum ?bumper)",
)  # fmt: skip
VALUES = {
    "wheel": ("?edge", "(* 4 ?light)", "(- ?wheel 1.5)", "(/ ?light (- ?steps 5))", -2),
    "gear": ("?steps", "(+ ?gear 1)", 1, "(* ?gear ?gear)", "(/ ?steps 2)"),
    "lamp": (True, False, "?bumper"),
}
SECONDS = (0.01, 0.05, 0.3, "?light", "(/ ?steps 100)")


def grow_robot(seed):
    """A random chart of two regions, whose states form rings."""
    pick = random.Random(seed).choice  # noqa: S311  no secrets
    handles = pick(range(8)) > 0

    def acts():
        motor = pick(("wheel", "gear", "lamp"))
        blink = {pick(("start", "stop")): pick(("blink", "hum"))}
        return pick(({"assign": {motor: pick(VALUES[motor])}}, {"perform": pick(("rest", "go"))}, blink))

    def way(to):
        event = {"emit": pick(("ping", "pong"))} if not pick(range(3)) else {}
        return {"when": pick(GUARDS), "do": [acts()], **event, **({} if to is None else {"to": to})}

    def state(name, following):
        on = {"cycle": [way(None), way(following), way(name)]} | ({"error": [{}]} if handles else {})
        for event in ("ping", "pong"):
            if pick((True, False)):
                on[event] = [way(pick((None, following)))]
        form = {"entry": acts(), "on": on}
        if pick((True, False)):
            form["exit"] = acts()
        if pick((True, False)):
            form["after"] = {"seconds": pick(SECONDS), "to": following}
        elif pick((True, False)):
            form["at_least"] = pick((0.02, 0.1))
        if pick((True, False)):
            form["every"] = {"seconds": pick((0.02, 0.07)), "do": [acts()]}
        if not pick(range(4)):
            form["always"] = {"to": following, "when": pick(GUARDS)}
        return form

    rings = {ring: {f"{ring}{n}": state(f"{ring}{n}", f"{ring}{(n + 1) % 3}") for n in range(3)} for ring in "ab"}
    ends = {"cycle": {"to": "over", "when": "(> ?steps 98)"}, "ping": {}, "pong": {}}
    states = {"all": {"regions": {ring: {"states": inside} for ring, inside in rings.items()}, "on": ends}}
    return ActionPlot.model_validate({
        "plot": f"robot{seed}", "receives": {"ping": {}, "pong": {}}, "states": {**states, "over": {"final": True}},
        "robot": {
            "sensors": {"light": "number from 0 to 1", "bumper": "boolean", "steps": "integer from 0 to 99"},
            "motors": {
                "wheel": "number from -3 to 3", "gear": {"type": "integer from 1 to 4", "initial": 2}, "lamp": "boolean",
            },
            "constants": {"edge": 0.4},
            "operations": {"rest": {"wheel": 0, "lamp": False}, "go": {"wheel": "(* 2 ?edge)", "gear": "(+ ?gear 1)"}},
            "activities": {
                "blink": {"start": {"lamp": True}, "stop": {"lamp": False, "wheel": "(/ ?light ?steps)"}},
                "hum": {"start": {"gear": "(/ ?steps 2)", "wheel": "(- ?wheel 1)"}},
            },
        },
    })  # fmt: skip


def draw_cycles(seed, cycles):
    """Times in nanoseconds, which begin anywhere, and values of sensors."""
    chance, drawn = random.Random(seed), []  # noqa: S311  no secrets
    now = chance.choice((0, 0, 7, -5_000_000_000, 1_000_000_000_000_000))
    for _ in range(cycles):
        steps = 99 if chance.random() < 0.005 else chance.randrange(9)
        drawn.append((now, {"light": round(chance.random(), 3), "bumper": chance.random() < 0.3, "steps": steps}))
        now += chance.choice((0, 5, 16, 32, 32, 100)) * 1_000_000
    return drawn
