"""Charts at random that can become controllers, and what happens to them.

The charts of `random_charts` have facts and one number; here the facts become variables with types, and skills,
settings, messages and outcomes get numbers.
"""

from __future__ import annotations

from random_charts import Grower

from dsc.model.plot import ActionPlot
from dsc.model.transitions import as_tuple

GUARDS = (
    "(= ?b true)", "(not (= ?event.b ?b))", "(< ?i 2)", "(= ?i 2)", "(> ?event.n 1)", "(or (= ?b true) (> ?event.n 1))",
    "(and (< (/ ?x ?i) 3) (!= ?i 0))", "(or (>= (/ 1 ?i) 0.2) (= ?i 0))", "(<= ?x (+ ?event.z ?i))", "(imply (= ?b true) (> ?x 1))",
    "(!= (* ?i ?i) 4)", "(and (= ?b true) (or (< (- ?i) 0) (= ?x 0.5)))", "(not (and (< ?i 9) (> ?x (* ?i 0.5))))", "(or)",
)  # fmt: skip
INTEGERS = ("(+ ?i 1)", "(+ ?i 1)", "(+ ?i 1)", 0, 0, 1, 2, "(* ?i ?i)", "(- ?i 7)", "?event.n", "(- ?i)", "(* 3 ?i)")
HALVES = ("(/ ?i 2)", "(/ ?event.z ?x)")
NUMBERS = ("(+ ?x 0.1)", "(/ ?x ?i)", "(* ?x 1e200)", "?event.z", "(- ?x ?i)", "(* ?i 0.5)", "(/ 1 ?x)", 0.5, "(- ?x)")
TRUTHS = (True, False, "?event.b", "?b")
SECONDS = (2, 1, 0.5, 0, 0.25, "?x", "(/ ?x 4)")
ATTRIBUTES = {"n": "integer", "z": "number", "b": "boolean"}


def grow(pick, scxml):
    """A plot at random; `pick(options)` makes all choices."""
    (plot,) = Grower(pick, scxml=scxml, alone=True).library()
    form = _Rewriting(pick, scxml).changed(plot.to_form())
    sent = ("e", "e.x", "e.y", "ex", "f", "g") if scxml else ("e", "f", "g")
    form["receives"] = {**dict.fromkeys(sent, ATTRIBUTES), "leave": {}}
    form["emits"] = {"out": {"n": "integer" if scxml else "integer from -3 to 9"}}
    bounds = "" if scxml else " from -1e15 to 1e15"
    form["variables"] = {
        "i": {"type": f"integer{bounds}", "initial": pick((0, 1))},
        "x": {"type": "number", "initial": 0.5},
        "b": {"type": "boolean", "initial": False},
    }
    if pick(range(4)):
        form["states"]["top"].setdefault("on", {})["error.execution" if scxml else "error"] = [{}]
    return ActionPlot.model_validate(form)


class _Rewriting:
    def __init__(self, pick, scxml):
        self.pick, self.scxml = pick, scxml

    def changed(self, node):
        if isinstance(node, list):
            return [self.changed(one) for one in node]
        if not isinstance(node, dict):
            return node
        if "switch" in node:
            return self._command(node)
        if "trigger" in node:
            return self._trigger(node)
        form = {key: self.changed(value) for key, value in node.items()}
        for key in ("when", "if"):
            if key in form:
                form[key] = self._guard(form[key])
        if "tell" in form or "assign" in form:
            form.pop("tell", None)
            form["assign"] = self._assigned()
        if "select" in form:
            form["select"] = self.pick(("?i", "?i", "?event.n"))
        if "seconds" in form:
            form["seconds"] = self.pick(SECONDS if form["seconds"] == 2 else SECONDS[:3])
        if "to" in form and not {"emit", "history"} & {*form} and not self.pick(range(8)):
            form.update({"emit": "out", "with": {"n": self.pick(("?i", "?event.n", 2))}})
        if any("trigger" in one for one in as_tuple(form.get("entry", ())) if isinstance(one, dict)):
            self._hear(form)
        return form

    def _guard(self, text):
        if "in-state" not in text:
            return self.pick(GUARDS)
        for fact in ("(p)", "(q)"):
            text = text.replace(fact, self.pick(GUARDS))
        return text

    def _assigned(self):
        values = {
            "i": self.pick(INTEGERS if self.scxml else (*INTEGERS, *HALVES)),
            "x": self.pick(NUMBERS),
            "b": self.pick(TRUTHS),
        }
        names = self.pick((("i",), ("x",), ("b",), ("i",), ("x", "i"), ("i", "b")))
        return {name: values[name] for name in names}

    def _command(self, node):
        return self.pick((
            node, node, node, {"set": "arm.speed", "to": self.pick(NUMBERS)}, {"set": "arm.way", "to": "near"},
            {"send": "arm.say", "with": {"count": "?i", "loud": "?b"}},
        ))  # fmt: skip

    def _trigger(self, node):
        arguments = self.pick(({}, {"count": "?i"}, {"level": "(/ 1 ?x)", "count": "?event.n"}))
        limits = self.pick(({}, {"within": 2}, {"within": 0.5}))
        return {**node, **limits, **({"with": arguments} if arguments else {})}

    def _hear(self, form):
        """Most skills end with an outcome that the state handles."""
        on = form.setdefault("on", {})
        for event in ("e", "f", "timed_out"):
            if self.pick(range(5)):
                on.setdefault(event, [{}])


def draw_play(pick, scxml):
    """What happens, as (what, which of those it can happen to, attributes, nanoseconds)."""
    events = ("e", "e.x", "e.y", "ex", "f", "g") if scxml else ("e", "f", "g")
    kinds = (*events, *events, "leave", *["end"] * 4, *["step"] * 7)
    attributes = {"n": (0, 1, 2, 3, 5, -5, 0, 1, 2, 3, 2**40), "z": (0.0, 2.5, -1.25, 1e300), "b": (True, False)}
    play = []
    for _ in range(pick(range(10, 40))):
        given = {name: pick(values) for name, values in attributes.items() if pick(range(4))}
        play.append((pick(kinds), pick(range(8)), given, pick((0, 1, 250_000_000, 500_000_000, 1_000_000_000))))
    return play
