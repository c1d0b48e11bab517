"""What must be true of plots before they run: one test for each rule, with its place and remedy."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import pytest
from dsc_charts import plot
from finding_codes import codes_in

from dsc.components.component import Component
from dsc.components.declarations import Parameter
from dsc.components.interface import Interface
from dsc.components.services import Service
from dsc.dynamic.library import Library
from dsc.errors import PlotError
from dsc.model.plot import ActionPlot
from dsc.outcomes import Outcome
from dsc.skills import skill
from dsc.text.plot_files import load_library, parse_plot
from dsc.validation import raise_findings, validate_library, validate_plot
from knowledge_base.world.schema import Schema

SCHEMA = Schema.parse("""
    (define (domain kitchen)
      (:types item place - object cup - item)
      (:constants table - place)
      (:predicates (on ?i - item ?p - place) (free))
      (:functions (failures ?i - item)))
""")


Item = Annotated[str, "item"]


class Grasped(Outcome): ...


class Slipped(Outcome):
    item: Item


class Pushed(Outcome): ...


class Arm(Component):
    name = "arm"

    @skill
    async def grasp(self, call, item: Item, speed=1) -> Grasped | Slipped:
        return Grasped()

    @skill
    async def push(self, call) -> Pushed:
        return Pushed()


SKILLS = list(Arm().skills().values())
COMPONENTS = {
    "arm": Interface(),
    "base": Interface(),
    "lift": Interface(
        {"pace": Parameter("number", default=1, least=0, most=2), "port": Parameter("text", changed_by="profile")},
        modes=("high", "low"),
        messages={},
        requires={"height": Service("push", {}, {"metres": "number"})},
    ),
    "ruler": Interface(pushes={"height": Service("push", {}, {"metres": "number"})}),
    "scale": Interface(pushes={"weight": Service("push", {}, {"kilograms": "number"})}),
}
HELPERS = [
    plot("{plot: driver, robot: {}, states: {a: {on: {cycle: over}}, over: {final: true}}}"),
    plot("""
        plot: grasp
        parameters: {item: item, speed: {type: number, default: 1}}
        emits: {failed: {item: item}, lost: }
        implements: pick-up
        receives: {ok: , bad: , worse: }
        states:
          s: {on: {bad: {to: over, emit: failed, with: {item: ?item}}, worse: {to: over, emit: lost}, ok: over}}
          over: {final: true}
    """),
    plot("""
        plot: search
        parameters: {item: item, place: {type: place, default: table}}
        outputs: {where: place, tries: {type: number, initial: 0}}
        receives: {ok: {at: place}}
        states:
          s: {on: {ok: {to: over, assign: {where: ?event.at}}}}
          over: {final: true}
    """),
    plot("""
        plot: ask
        parameters: {item: item}
        outputs: {where: place, tries: {type: text, initial: none}}
        emits: {nobody: {item: item}}
        receives: {ok: {at: place}, no: }
        states:
          s: {on: {ok: {to: over, assign: {where: ?event.at}}, no: {to: over, emit: nobody, with: {item: ?item}}}}
          over: {final: true}
    """),
    plot("{plot: wait, states: {s: {after: {seconds: 1, to: over}}, over: {final: true}}}"),
    plot("{plot: talk, emits: {said: }, states: {s: {after: {seconds: 1, to: over}}, over: {final: true, emit: said}}}"),
]  # fmt: skip
RINGS = [
    plot("{plot: ring, states: {s: {use: p, on: {done: over}}, over: {final: true}}}"),
    plot("{plot: endless, states: {s: {use: endless, on: {done: over}}, over: {final: true}}}"),
    plot("{plot: choice, states: {s: {dynamic: [p], on: {done: over, no_candidate: over}}, over: {final: true}}}"),
]


def findings_of(text, schema=SCHEMA, skills=SKILLS):
    made = parse_plot(text, "p.yaml")
    return validate_plot(made, Library([made, *HELPERS, *RINGS]), schema, skills, COMPONENTS)


S = "plot: p\nstates:\n"
ROBOT = """plot: p
robot:
  sensors: {s: number from 0 to 9}
  motors: {m: number from -6 to 6}
  constants: {fast: 9}
"""
E = "  e: {final: true}\n"
ITEM = "plot: p\nparameters: {item: item}\nstates:\n"
GRASP = "    use: grasp\n    with: {item: ?item}\n"
WIRED = "    on: {done: e, failed: e, lost: e}\n"
H = "plot: p\ndialect: scxml\nstates:\n"
FOUND = "  s: {{use: search, {}on: {{done: e}}}}\n  e: {{final: true}}\n"
WRONG = [
    # -- structure
    ("initial", "plot: p\ninitial: b\nstates: {a: {on: {done: a}}}\n", 2, "no state 'b' to begin with", ""),
    ("initial", S + "  a:\n    on: {done: e}\n    states: {b: {on: {done: b}}}\n    initial: c\n" + E, 6, "'c' to begin", ""),
    (
        "initial",
        S + "  a:\n    on: {done: e}\n    regions:\n      r:\n        states: {b: {on: {done: b}}}\n        initial: c\n" + E,
        8, "'c' to begin", "",
    ),
    ("target", S + "  start:\n    on:\n      done: ende\n  end: {final: true}\n", 5, "did you mean 'end'", ""),
    ("target", S + "  a:\n    after: {seconds: 1, to: b}\n" + E, 4, "no state 'b'", ""),
    ("target", S + "  a:\n    always:\n      - {to: b}\n" + E, 5, "no state 'b'", ""),
    (
        "no-border-crossing",
        S + "  a:\n    on: {done: e}\n    states:\n      b:\n        on: {done: e}\n" + E,
        7, "the transition to 'e' crosses a border", "transitions stay in",
    ),
    ("known-plot", S + "  a:\n    use: wiat\n    on: {done: e}\n" + E, 4, "did you mean 'wait'", ""),
    ("known-plot", S + "  a:\n    use: ?plan\n    on: {done: e}\n" + E, 4, "'?plan'", ""),
    ("known-plot", S + "  a:\n    dynamic: [wait, tlk]\n    on: {done: e, no_candidate: e}\n" + E, 4, "mean 'talk'", ""),
    ("known-plot", S + "  a: {on: {done: e}}\n" + E + "rules:\n  - on: x\n    do: {use: wiat}\n", 7, "mean 'wait'", ""),
    ("no-dead-end", S + "  a:\n    entry: {switch: arm, to: up}\n" + E, 3, "no transition leaves the state 'a'", "final: true"),
    ("rule-response", ITEM + "  a:\n" + GRASP + WIRED + E + "rules:\n  - on: lost\n    do: {then: retri}\n", 11, "mean 'retry'", ""),
    ("rule", ITEM + "  abc:\n" + GRASP + WIRED + E + "rules:\n  - on: lost\n    of: [abd]\n    do: {}\n", 11, "mean 'abc'", ""),
    # -- wiring
    (
        "rules",
        ITEM + "  a:\n" + GRASP + "    on: {done: e, failed: e}\n" + E + "rules:\n  - on: lost\n    do: {then: give_up}\n",
        11, "does not wire 'gave_up'", "",
    ),
    (
        "every-outcome-is-wired",
        ITEM + "  a:\n" + GRASP + "    on: {done: e, failed: e}\n" + E,
        7, "does not handle its outcome 'lost'", "add `lost: STATE` under `on`, or a rule",
    ),
    (
        "every-outcome-is-wired",
        ITEM + "  a:\n" + GRASP + "    on:\n      done: e\n      failed: e\n      lost: {to: e, when: (free)}\n" + E,
        10, "every transition has a guard", "without `when`",
    ),
    ("every-outcome-is-wired", S + "  a:\n    dynamic: [wait]\n    on: {done: e}\n" + E, 5, "'no_candidate'", "no_candidate: STATE"),
    ("every-outcome-is-wired", S + "  a:\n    goal: (free)\n    on: {done: e, gave_up: e}\n" + E, 5, "'no_plan'", "no_plan: STATE"),
    (
        "every-outcome-is-wired",
        ITEM + "  a:\n    entry: {trigger: arm.grasp, with: {item: ?item}}\n    on: {grasped: e}\n" + E,
        6, "'slipped'", "slipped: STATE",
    ),
    (
        "known-skill",
        S + "  a:\n    entry:\n      - {trigger: arm.grsp}\n    on: {error: e}\n" + E,
        5, "no component offers the skill or event 'arm.grsp'; did you mean 'arm.grasp'", "",
    ),
    (
        "known-component",
        S + "  a:\n    entry:\n      - {set: base.speed, to: slow}\n      - {switch: bse, to: neutral}\n    on: {done: e}\n" + E,
        6, "there is no component 'bse'; did you mean 'base'", "",
    ),
    (
        "known-component",
        S + "  a:\n    entry: {set: base.speed, to: slow}\n    exit: {set: arn.speed, to: 1}\n    on: {done: e}\n" + E,
        5, "there is no component 'arn'; did you mean 'arm'", "",
    ),
    (
        "known-outcome",
        ITEM + "  a:\n    entry:\n      trigger: arm.grasp\n      with: {item: ?item}\n      as: {graspd: ok}\n"
        "    on: {grasped: e, slipped: e}\n" + E,
        8, "has no outcome 'graspd'; did you mean 'grasped'", "",
    ),
    ("completion-is-wired", S + "  a:\n    use: wait\n    on: {error: e}\n" + E, 5, "does not handle its completion", "done: STATE"),
    (
        "completion-is-wired",
        S + "  a:\n    on: {error: e}\n    states: {b: {on: {done: c}}, c: {final: true}}\n" + E,
        4, "completion", "done: STATE",
    ),
    (
        "completion-is-wired",
        S + "  a:\n    on: {error: e}\n    regions: {r: {states: {c: {final: true}}}}\n" + E,
        4, "completion", "done: STATE",
    ),
    ("completion-is-wired", S + "  a:\n    dynamic: [wait]\n    on: {no_candidate: e}\n" + E, 5, "completion", "done: STATE"),
    ("completion-is-wired", S + "  a:\n    goal: (free)\n    on: {no_plan: e, gave_up: e}\n" + E, 5, "completion", "done: STATE"),
    (
        "known-event",
        "plot: p\nreceives: {stop: }\nstates:\n  a:\n    on:\n      stpo: e\n" + E,
        6, "nothing here fires the event 'stpo'; did you mean 'stop'", "declared under `receives`",
    ),
    (
        "declared-outcome",
        "plot: p\nemits: {lost: }\nstates:\n  a:\n    on:\n      done: {to: e, emit: lots}\n" + E,
        6, "does not declare the outcome 'lots', and no state listens to it; did you mean 'lost'", "under `emits`",
    ),
    (
        "declared-outcome",
        "plot: p\nemits: {lost: }\nstates:\n  a: {on: {done: e}}\n  e:\n    final: true\n    emit: lots\n",
        7, "does not declare the outcome 'lots'; did you mean 'lost'", "under `emits`",
    ),
    (
        "outcome-attributes",
        "plot: p\nemits: {lost: {item: item}}\nstates:\n  a: {on: {done: e}}\n  e:\n    final: true\n    emit: lost\n",
        7, "attribute 'item' of the outcome 'lost' is missing", "",
    ),
    (
        "outcome-attributes",
        "plot: p\nemits: {lost: }\nstates:\n  a:\n    on:\n      done: {to: e, emit: lost, with: {why: x}}\n" + E,
        6, "attribute 'why' of the outcome 'lost' is not declared", "",
    ),
    # -- names with a meaning
    ("reserved-event", "plot: p\nemits:\n  done:\nstates: {a: {on: {done: e}}, e: {final: true, emit: done}}\n", 3, "'done'", ""),
    ("reserved-event", "plot: p\nreceives:\n  after:\nstates: {a: {on: {done: e}}, e: {final: true}}\n", 3, "'after'", ""),
    ("reserved-event", S + "  a:\n    on:\n      done: {to: e, emit: error}\n      error: e\n" + E, 5, "'error'", ""),
    (
        "reserved-event",
        S + "  a:\n    entry: {trigger: arm.push, as: {pushed: done}}\n    on: {timed_out: e}\n" + E,
        4, "'done' is fired by the executive itself", "another name",
    ),
    (
        "done-at-once",
        S + "  a:\n    entry: {trigger: arm.push}\n    on: {pushed: e, done: e}\n" + E,
        5, "state 'a' has no content, so it is done immediately and would cancel its skill", "the outcome of the skill",
    ),
    # -- data
    ("known-type", "plot: p\nparameters:\n  x: itme\nstates: {a: {on: {done: e}}, e: {final: true}}\n", 3, "mean 'item'", ""),
    ("known-type", "plot: p\nvariables:\n  x: nubmer\nstates: {a: {on: {done: e}}, e: {final: true}}\n", 3, "mean 'number'", ""),
    (
        "declared-variable",
        "plot: p\nvariables: {count: number}\nstates:\n  a:\n    on:\n      done: {to: e, assign: {cuont: 1}}\n" + E,
        6, "there is no variable 'cuont'; did you mean 'count'", "",
    ),
    ("declared-variable", ITEM + "  a:\n    use: grasp\n    with: {item: ?itm}\n" + WIRED + E, 6, "no variable '?itm' here; did you mean", ""),
    ("declared-variable", S + "  a:\n    after: {seconds: ?nope, to: e}\n" + E, 4, "no variable '?nope'", ""),
    ("declared-variable", S + "  a:\n    entry: {set: arm.x, to: ?nope}\n    on: {done: e}\n" + E, 4, "no variable '?nope'", ""),
    (
        "declared-variable",
        ITEM + "  a:\n" + GRASP + "    on:\n      done: e\n      lost: e\n      failed: {to: e, assign: {x: ?event.itm}}\n" + E
        + "variables: {x: item}\n",
        10, "no variable '?event.itm' here; did you mean 'event.item'", "",
    ),
    (
        "declared-variable",
        ITEM + "  a:\n    goal: (free)\n    on: {done: e, no_plan: e, gave_up: e}\n" + E
        + "rules:\n  - on: lost\n    when: (on ?item table)\n    do: {then: e}\n",
        9, "'?item' is a variable of this plot; a rule that answers for steps of plans cannot read it", "read a fact instead",
    ),
    (
        "declared-variable",
        ITEM + "  a:\n" + GRASP + "    on: {done: e, failed: e}\n" + E
        + "rules:\n  - on: lost\n    do: {use: grasp, with: {item: ?itm}, on: {failed: e, lost: e}, then: e}\n",
        11, "no variable '?itm' here; did you mean 'item'", "",
    ),
    (
        "skill-arguments",
        ITEM + "  a:\n    entry:\n      trigger: arm.grasp\n      with: {itm: ?item}\n    on: {grasped: e, slipped: e}\n" + E,
        7, "has no parameter 'itm'; did you mean 'item'", "",
    ),
    (
        "skill-arguments",
        S + "  a:\n    entry:\n      - {trigger: arm.grasp}\n    on: {grasped: e, slipped: e}\n" + E,
        5, "needs its parameter 'item'", "",
    ),
    ("known-parameter", ITEM + "  a:\n    use: grasp\n    with: {item: ?item, sped: 1}\n" + WIRED + E, 6, "mean 'speed'", ""),
    ("parameters-are-given", S + "  a:\n    use: grasp\n    with: {speed: 2}\n" + WIRED + E, 5, "needs its parameter 'item'", "add `item"),
    (
        "parameters-are-given",
        S + "  a:\n    dynamic: [grasp]\n    on: {done: e, failed: e, lost: e, no_candidate: e}\n" + E,
        3, "'grasp' needs its parameter 'item'", "add `item",
    ),
    (
        "parameters-are-given",
        ITEM + "  a:\n" + GRASP + "    on: {done: e, failed: e}\n" + E + "rules:\n  - on: lost\n    do: {use: grasp, on: {failed: e, lost: e}, then: e}\n",
        11, "'grasp' needs its parameter 'item'", "add `item",
    ),
    (
        "candidates-conform",
        S + "  a:\n    dynamic: [wait]\n    with:\n      tme: 1\n    on: {done: e, no_candidate: e}\n" + E,
        6, "no candidate has a parameter 'tme'", "",
    ),
    ("condition", "plot: p\nwhen: (fre)\nstates: {a: {on: {done: e}}, e: {final: true}}\n", 2, "mean 'free'", ""),
    ("condition", ITEM + "  a:\n    on:\n      done: [{to: e, when: (on ?item)}, e]\n" + E, 6, "on", ""),
    ("condition", ITEM + "  a:\n    on:\n      done: [{to: e, when: (on ?i table)}, e]\n" + E, 6, "?i", ""),
    ("condition", S + "  a:\n    goal: (on table table)\n    on: {done: e, no_plan: e, gave_up: e}\n" + E, 4, "of type place", ""),
    (
        "condition",
        ITEM + "  a:\n" + GRASP + WIRED + E + "rules:\n  - on: lost\n    when: (on ?itm table)\n    do: {}\n",
        11, "?itm", "",
    ),
    (
        "bindings",
        "plot: p\nvariables: {found: list of item}\nstates:\n  a:\n    on:\n      done: {to: e, bind: {found: (free)}}\n" + E,
        6, "'found' is a list of item, and `bind` finds one value", "use `bind_all`",
    ),
    ("effect", ITEM + "  a:\n    on:\n      done: {to: e, tell: (onn ?item table)}\n" + E, 6, "mean 'on'", ""),
    (
        "effect",
        ITEM + "  a:\n" + GRASP + WIRED + E + "rules:\n  - on: lost\n    do: {tell: (on ?itm table)}\n",
        11, "?itm", "",
    ),
    ("rule-event", ITEM + "  a:\n" + GRASP + WIRED + E + "rules:\n  - on: lots\n    do: {then: e}\n", 10, "mean 'lost'", ""),
    (
        "value-fits", S + "  a: {entry: {trigger: arm.grasp, with: {item: Cup1}}, on: {grasped: e, slipped: e}}\n" + E,
        3, "'item' is of type item, and the name of an object is in lower case", "write cup1",
    ),
    ("value-fits", ITEM + "  a:\n    use: grasp\n    with: {item: ?item, speed: fast}\n" + WIRED + E, 6, "'speed' is of type number", ""),
    ("value-fits", S + "  a:\n    use: grasp\n    with: {item: table}\n" + WIRED + E, 5, "table is of type place", ""),
    ("value-fits", "plot: p\nparameters:\n  n: {type: number, default: x}\nstates: {e: {final: true}}\n", 3, "of type number", ""),
    ("value-fits", ITEM + "  a:\n    after: {seconds: ?item, to: e}\n" + E, 5, "?item is of type item", ""),
    (
        "value-fits",
        "plot: p\nvariables: {n: number}\nstates:\n  a:\n    on:\n      done: {to: e, assign: {n: true}}\n" + E,
        6, "true is of type boolean", "",
    ),
    (
        "value-fits",
        "plot: p\nemits: {lost: {n: number}}\nstates:\n  a: {on: {done: e}}\n  e: {final: true, emit: lost, with: {n: x}}\n",
        5, "'n' is of type number", "",
    ),
    ("value-fits", S + "  a:\n    entry:\n      - {trigger: arm.grasp, with: {item: 5}}\n    on: {grasped: e, slipped: e}\n" + E, 5, "5 is of type number", ""),
    (
        "term",
        "plot: p\nvariables: {n: number}\nstates:\n  a:\n    on:\n      done: {to: e, assign: {n: (failurs table)}}\n" + E,
        6, "mean 'failures'", "",
    ),
    # -- what can be entered
    ("reachable", S + "  a: {on: {done: e}}\n  b: {on: {done: e}}\n" + E, 4, "nothing leads to the state 'b'", "`initial`"),
    ("reachable", S + "  a:\n    on: {done: e}\n    states: {b: {final: true}, c: {final: true}}\n" + E, 5, "state 'c'", ""),
    ("reachable", S + "  a:\n    on: {done: e}\n    regions: {r: {states: {b: {final: true}, c: {final: true}}}}\n" + E, 5, "state 'c'", ""),
    ("no-circle", S + "  a:\n    use: p\n    on: {done: e}\n" + E, 4, "in a cycle: p -> p", "in a dynamic state"),
    ("no-circle", S + "  a:\n    use: ring\n    on: {done: e}\n" + E, 4, "in a cycle: p -> ring -> p", "in a dynamic state"),
    ("no-circle", S + "  a:\n    use: endless\n    on: {done: e}\n" + E, 4, "in a cycle: endless -> endless", ""),
    (
        "bounded-rules",
        S + "  a:\n    goal: (free)\n    on: {done: e, no_plan: e, gave_up: e}\n" + E + "rules:\n"
        + "  - {on: no_plan, when: (free), do: {then: e}}\n" * 1001,
        7, "the rules would make 1001 transitions; at most 1000", "with `of`",
    ),
    ("something-to-choose", S + "  a:\n    dynamic: []\n    on: {no_candidate: e}\n" + E, 4, "'a' has nothing to choose", "a `goal`"),
    # -- connectors
    ("target", S + "  a: {on: {done: b}}\n  b:\n    choice:\n      - {when: (free), to: d}\n      - e\n" + E, 6, "no state 'd'", ""),
    ("target", S + "  a: {on: {done: b}}\n  b:\n    select: 1\n    cases:\n      cup: d\n    else: e\n" + E, 7, "no state 'd'", ""),
    (
        "no-border-crossing",
        S + "  a: {on: {done: b}}\n  c: {states: {d: {on: {done: d}}}, on: {done: e}}\n  b:\n    choice: [d]\n" + E,
        6, "crosses a border", "",
    ),
    ("choice", S + "  a: {on: {done: b}}\n  b:\n    choice: [{when: (free), to: e}]\n" + E, 5, "last branch has a `when`", "end with"),
    (
        "choice",
        S + "  a: {on: {done: b}}\n  b: {select: 1, cases: {1: e},\n    else: {when: (free), to: e}}\n" + E,
        5, "last branch has a `when`", "end with",
    ),
    ("choice", S + "  a: {on: {done: b}}\n  b:\n    choice:\n      - a\n      - e\n" + E, 6, "never reached", "put it last"),
    (
        "connectors-lead-on",
        S + "  a: {on: {done: b}}\n  b:\n    choice: [{when: (free), to: b}, e]\n" + E, 4, "from 'b' back", "",
    ),
    (
        "condition",
        S + "  a: {on: {done: b}}\n  b:\n    choice:\n      - {when: (fre), to: e}\n      - e\n" + E, 6, "mean 'free'", "",
    ),
    (
        "condition",
        "plot: p\nvariables: {n: number}\nstates:\n  a: {on: {done: b}}\n  b:\n    select: ?n\n    cases:\n"
        "      2: e\n      1: {when: (fre), to: e}\n    else: e\n" + E,
        9, "mean 'free'", "",
    ),
    ("declared-variable", S + "  a: {on: {done: b}}\n  b:\n    choice:\n      - {assign: {n: 1}, to: e}\n" + E, 6, "no variable 'n'", ""),
    (
        "declared-outcome",
        S + "  a: {on: {done: b}}\n  b:\n    choice:\n      - {emit: lost, to: e}\n" + E, 6, "outcome 'lost'", "emits",
    ),
    # -- times
    ("at-least", S + "  a:\n    at_least: 2\n    after: {seconds: 1.5, to: e}\n" + E, 5, "at least 2 s", "2 s or more"),
    ("declared-variable", S + "  a:\n    at_least: ?n\n    on: {done: e}\n" + E, 4, "?n", ""),
    ("declared-variable", S + "  a:\n    every:\n      seconds: ?n\n      to: e\n" + E, 5, "?n", ""),
    ("condition", S + "  a:\n    every:\n      seconds: 1\n      when: (fre)\n    on: {done: e}\n" + E, 6, "mean 'free'", ""),
    ("effect", S + "  a:\n    every: {seconds: 1, tell: (fre)}\n    on: {done: e}\n" + E, 4, "mean 'free'", ""),
    ("declared-outcome", S + "  a:\n    every: {seconds: 1, emit: lost}\n    on: {done: e}\n" + E, 4, "outcome 'lost'", ""),
    ("known-event", S + "  a:\n    on:\n      done: e\n      every: e\n" + E, 6, "fires the event 'every'", ""),
    ("reserved-event", "plot: p\nreceives: {at_least: }\nstates:\n  a: {on: {done: e}}\n" + E, 2, "'at_least'", ""),
    # -- what happens on a break
    ("known-component", S + "  a:\n    on_break: {switch: leg, to: up}\n    on: {done: e}\n" + E, 4, "leg", ""),
    ("declared-variable", S + "  a:\n    on_break: {set: arm.speed, to: ?n}\n    on: {done: e}\n" + E, 4, "?n", ""),
    # -- histories
    (
        "clear",
        H + "  a:\n    on: {out: {to: e, clear: aa}}\n    states: {b: {}, h: {history: shallow, to: b}}\n" + E,
        5, "did you mean 'a'", "",
    ),
    (
        "clear",
        H + "  a:\n    on: {out: {to: e, clear: a}}\n    states: {b: {states: {c: {}, h: {history: deep, to: c}}}}\n" + E,
        5, "'a' has no history", '"a*"',
    ),
    # -- what is passed
    (
        "arguments-are-taken",
        S + "  a: {on: {done: b}}\n  b:\n    on: {done: {to: e, pass: {n: 1}}}\n" + E, 5, "to 'e', which holds no plot", "use",
    ),
    ("arguments-are-taken", S + "  a: {every: {seconds: 1, pass: {n: 1}}, on: {done: e}}\n" + E, 3, "leads nowhere", ""),
    (
        "known-parameter",
        ITEM + "  a:\n    on:\n      done: {to: s, pass: {itm: ?item}}\n" + FOUND.format("with: {item: ?item}, "), 6, "mean 'item'", "",
    ),
    (
        "candidates-conform",
        ITEM + "  a:\n    on:\n      done: {to: s, pass: {itm: ?item}}\n"
        "  s: {dynamic: [search], with: {item: ?item}, on: {done: e, no_candidate: e}}\n" + E,
        6, "mean 'item'", "",
    ),
    ("declared-variable", S + "  a:\n    on:\n      done: {to: s, pass: {item: ?itm}}\n" + FOUND.format(""), 5, "?itm", ""),
    (
        "parameters-are-given",
        ITEM + "  a:\n    on:\n      done: {to: s, pass: {item: ?item}}\n      error: s\n" + FOUND.format(""),
        7, "a transition leads to 's' and does not pass 'item', which plot 'search' needs", "`pass`",
    ),
    (
        "parameters-are-given",
        H.replace("states:", "parameters: {item: item}\nstates:") + "  a:\n    on: {out: h}\n    states:\n"
        "      b: {on: {go: {to: s, pass: {item: ?item}}}}\n      s: {use: search}\n      h: {history: deep, to: b}\n",
        9, "entered without a transition", "`with`",
    ),
    (
        "parameters-are-given",
        H.replace("states:", "parameters: {item: item}\nstates:") + "  a: {on: {go: o}}\n  o:\n    regions:\n"
        "      r: {states: {b: {on: {go: {to: s, pass: {item: ?item}}}}, s: {use: search}}}\n"
        "      q: {states: {c: {}, d: {use: ask, with: {item: ?item}, on: {nobody: a,\n"
        "        go: {to: d, also: [s], pass: {item: ?item}}}}}}\n",
        10, "a transition leads to 's' and does not pass", "`pass`",
    ),
    (
        "parameters-are-given",
        ITEM + "  a:\n    on:\n      done: {to: s, pass: {item: ?item}}\n      error: e\n"
        "  s: {use: search, on: {done: a}}\n" + E + "initial: s\n",
        8, "entered without a transition", "`with`",
    ),
    (
        "parameters-are-given",
        ITEM + "  a: {on: {done: {to: s, pass: {item: ?item}}}}\n  s: {use: ask, on: {done: e}}\n" + E
        + "rules:\n  - {on: nobody, do: {then: retry}}\n  - {on: nobody, do: {then: e}}\n",
        5, "the rule 'nobody: retry' leads to 's'", "`with`",
    ),
    (
        "parameters-are-given",
        ITEM + "  a: {on: {done: {to: s, pass: {item: ?item}}}}\n  s: {use: ask, on: {done: e}}\n" + E
        + "rules:\n  - {on: nobody, do: {use: wait, then: retry}}\n  - {on: nobody, do: {then: e}}\n",
        5, "a rule's recovery leads to 's'", "`with`",
    ),
    # -- what is handed back
    ("outputs-are-given", "plot: p\noutputs: {n: number}\nstates:\n  a: {on: {done: e}}\n" + E, 2, "never gets a value", "initial"),
    ("known-type", "plot: p\noutputs: {n: {type: nmber, initial: 1}}\nstates:\n  a: {on: {done: e}}\n" + E, 2, "mean 'number'", ""),
    (
        "declared-variable",
        ITEM + "  s:\n    use: search\n    with: {item: ?item}\n    on:\n      done: {to: e, emit: x, with: {w: ?event.were}}\n      x: e\n" + E,
        8, "mean 'event.where'", "",
    ),
    (
        "condition",
        ITEM + "  s:\n    use: search\n    with: {item: ?item}\n    on:\n      done: [{to: e, when: (on ?event.tries table)}, e]\n" + E,
        8, "number", "",
    ),
    # candidates that agree on a name and not on its type have no such output
    (
        "declared-variable",
        ITEM + "  s:\n    dynamic: [search, ask]\n    with: {item: ?item}\n    on:\n"
        "      done: {to: s, assign: {n: ?event.tries}}\n      no_candidate: e\n      nobody: e\n" + E + "variables: {n: text}\n",
        8, "?event.tries", "",
    ),
    # a goal that is reached, by a candidate or a plan, hands nothing back
    (
        "declared-variable",
        ITEM + "  s:\n    dynamic: [search]\n    goal: (free)\n    with: {item: ?item}\n    on:\n"
        "      done: {to: e, assign: {n: ?event.where}}\n      no_plan: e\n      gave_up: e\n" + E + "variables: {n: place}\n",
        9, "?event.where", "",
    ),
    ("declared-variable", S + "  a:\n    on:\n      done: [{to: e, when: (free), emit: x, with: {w: ?event.where}}, e]\n      x: e\n" + E, 5, "?event.where", ""),
    (
        "declared-variable",
        ITEM + "  s: {use: ask, with: {item: ?item}, on: {done: {to: e, assign: {w: ?event.where}}}}\n" + E
        + "variables: {w: place}\nrules:\n  - on: nobody\n    do: {then: continue}\n",
        9, "?event.where", "",
    ),
    # -- rules that insert, handlers
    ("rule-response", ITEM + "  a:\n" + GRASP + WIRED + E + "rules:\n  - before: a\n    do: {then: retry}\n", 11, "cannot 'retry' before a step", ""),
    ("rule", ITEM + "  abc:\n" + GRASP + WIRED + E + "rules:\n  - after: [pick-upp]\n    do: {use: wait}\n", 10, "mean 'pick-up'", ""),
    ("arguments-are-taken", ITEM + "  a:\n" + GRASP + WIRED + E + "rules:\n  - after: a\n    do: {use: wait, pass: {speed: 2}}\n", 11, "whose response is 'continue'", "retry"),
    ("known-parameter", ITEM + "  a:\n" + GRASP + WIRED + E + "rules:\n  - before: a\n    do: {pass: {sped: 2}}\n", 11, "mean 'speed'", ""),
    ("condition", ITEM + "  a:\n" + GRASP + WIRED + E + "rules:\n  - before: a\n    when: (on ?step.itm table)\n    do: {use: wait}\n", 11, "mean '?step.item'", ""),
    ("known-component", ITEM + "  a:\n" + GRASP + WIRED + E + "rules:\n  - before: a\n    do: {command: [{switch: amr, to: rest}]}\n", 11, "mean 'arm'", ""),
    ("rule-event", ITEM + "  a:\n" + GRASP + "    on: {done: b, failed: e, lost: e}\n  b: {use: wait, on: {done: e}}\n" + E + "rules:\n  - on: lost\n    of: b\n    do: {then: e}\n", 11, "'b' cannot end with 'lost'", ""),
    ("known-type", "plot: p\nparameters: {n: float}\nstates:\n" + E, 2, "no type 'float'", "write number"),
    ("known-event", S + "  a: {on: {done: e}}\n" + E + "handlers:\n  - on: low\n    do: {use: wait}\n", 6, "nothing here fires the event 'low'", "listen"),
    ("handlers", S + "  a: {on: {done: e, x: e}}\n" + E + "receives: {x: }\nhandlers:\n  - on: x\n    interrupt: true\n    do: {tell: (free)}\n", 7, "interrupts nothing", "use"),
    ("dialect", H + "  a: {on: {x: e}}\n" + E + "receives: {x: }\nhandlers:\n  - on: x\n    do: {use: wait}\n", 7, "handlers are for plots of dialect dsc", "transitions"),
    ("connectors-lead-on", S + "  a: {use: wait, on: {done: b}, after: {seconds: 9, to: e}}\n  b: {use: wait, on: {done: a}}\n" + E
     + "rules:\n  - {before: [a, b], when: (free), do: {then: continue}}\n", 6, "all steps of a cycle", "`then`"),
    # -- parameters of components
    ("parameter-roles", "parameters:\n  n: {type: number, default: 5, most: 3}\n" + S + E, 2, "'p.n' is 3 or less; found 5", ""),
    ("parameter-roles", "parameters:\n  n: {type: number, changed_by: profile}\n" + S + E, 2, "'n' needs a default", "a profile may set another one"),
    ("component-parameter", S + "  a:\n    entry:\n      set: lift.pace\n      to: 3\n    on: {done: e}\n" + E, 6, "from 0 to 2; found 3", ""),
    ("component-parameter", S + "  a:\n    entry:\n      set: lift.port\n      to: x\n    on: {done: e}\n" + E, 5, "not changed by plots", "changed_by"),
    ("done-can-fire", S + "  a:\n    states: {b: {after: {seconds: 1, to: c}}, c: {after: {seconds: 1, to: b}}}\n    on: {done: e}\n" + E, 5, "'a' is never done: it has no final state", ""),
    ("declared-variable", "plot: p\nparameters: {n: {type: number, default: 1}}\nstates:\n  a:\n    on:\n      done: {to: e, assign: {n: 2}}\n" + E, 6, "'n' is a parameter, which the plot only reads", ""),
    ("component-mode", S + "  a:\n    entry:\n      switch: lift\n      to: hihg\n    on: {done: e}\n" + E, 6, "did you mean 'high'", ""),
    ("component-wire", S + "  a:\n    entry:\n      wire: lift.hight\n      to: ruler.height\n    on: {done: e}\n" + E, 5, "did you mean 'height'", ""),
    ("component-wire", S + "  a:\n    entry:\n      unwire: lift.hight\n    on: {done: e}\n" + E, 5, "did you mean 'height'", ""),
    ("component-wire", S + "  a:\n    entry:\n      wire: lift.height\n      to: rular.height\n    on: {done: e}\n" + E, 6, "did you mean 'ruler'", ""),
    ("component-wire", S + "  a:\n    entry:\n      wire: lift.height\n      to: scale.weight\n    on: {done: e}\n" + E, 6, "pushes no 'metres'", ""),
    ("component-wire", S + "  a:\n    exit:\n      wire: lift.height\n      to: ruler.height\n    on: {done: e}\n" + E, 4, "stands in `entry`", ""),
    ("component-wire", S + "  a:\n    on_break: [{unwire: lift.height}]\n    on: {done: e}\n" + E, 4, "stands in `entry`", ""),
    ("component-message", S + "  a:\n    entry:\n      send: lift.lable\n    on: {done: e}\n" + E, 5, "takes no 'lable'", ""),
    # -- robot sections
    ("robot", ROBOT + "  operations:\n    go: {n: 1}\nstates: {a: {on: {cycle: a}}}\n", 7, "'n' is no motor, and an operation sets motors", "`motors`"),
    ("robot", ROBOT + "states:\n  a:\n    entry:\n      - perform: go\n    on: {cycle: a}\n", 9, "no operation 'go'", "`operations`"),
    ("robot", ROBOT + "  activities:\n    go: {stop: {n: 1}}\nstates: {a: {on: {cycle: a}}}\n", 7, "'n' is no motor, and an activity sets motors", "`motors`"),
    ("robot", ROBOT + "  activities: {blink: {}}\nstates:\n  a:\n    entry: {start: blnk}\n    on: {cycle: a}\n", 9, "no activity 'blnk'; did you mean 'blink'", "`activities`"),
    ("robot", ROBOT + "states:\n  a:\n    on:\n      cycle: {do: [{stop: blink}]}\n", 9, "no activity 'blink'", "`activities`"),
    ("declared-variable", ROBOT + "  activities: {blink: {}}\nstates:\n  a:\n    on:\n      cycle: {assign: {blink: true}}\n", 10, "'blink' is an activity, which the plot only reads", ""),
    ("value-fits", ROBOT + "  activities:\n    go: {start: {m: 7}}\nstates: {a: {entry: {start: go}, on: {cycle: a}}}\n", 7, "not 7", ""),
    ("robot", ROBOT + "receives:\n  cycle: \nstates: {a: {on: {cycle: a}}}\n", 7, "`robot` declares the event 'cycle'", "another name"),
    ("robot", ROBOT + "states:\n  a:\n    on:\n      cycle: {emit: cycle}\n", 9, "fires 'cycle'", "another name"),
    ("robot", "plot: p\nrobot:\n  motors:\n    m: {type: number to 1, initial: 2}\nstates: {a: {on: {cycle: a}}}\n", 4, "'m' is a number to 1, not 2", ""),
    ("robot", S + "  a:\n    use: driver\n    on: {done: e}\n" + E, 4, "only the outermost plot drives a robot", "parameters"),
    ("value-fits", ROBOT + "states:\n  a:\n    entry:\n      assign: {m: ?fast}\n    on: {cycle: a}\n", 9, "'m' is a number from -6 to 6, not 9", ""),
    ("value-fits", ROBOT + "  operations:\n    go: {m: 7}\nstates: {a: {entry: {perform: go}, on: {cycle: a}}}\n", 7, "not 7", ""),
    ("declared-variable", ROBOT + "states:\n  a:\n    on:\n      cycle: {assign: {s: 1}}\n", 9, "'s' is a sensor, which the plot only reads", ""),
    ("dialect", ROBOT + "variables: {v: number}\nstates:\n  a:\n    entry: {assign: {v: 1}}\n    on: {cycle: a}\n", 9, "internal action", ""),
    # -- rules are transitions too
    (
        "no-border-crossing",
        ITEM + "  c:\n    on: {done: e}\n    states:\n      a: {use: grasp, with: {item: ?item}, on: {done: f, failed: f}}\n"
        "      f: {final: true}\n" + E + "rules:\n  - on: lost\n    do: {then: e}\n",
        12, "from 'a' to 'e' crosses a border", "`of`",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("rule", "text", "line", "message", "fix"), WRONG)
def test_a_wrong_plot_gets_one_finding_with_place_rule_and_remedy(rule, text, line, message, fix):
    findings = findings_of(text)
    assert [str(finding) for finding in findings if finding.code != rule] == []
    (finding,) = findings
    assert message in str(finding)
    assert fix in finding.fix
    assert finding.place is not None
    assert (finding.place.source, finding.place.line) == ("p.yaml", line)
    assert str(finding).startswith(f"p.yaml:{line}:")


def test_every_rule_of_the_validator_is_tested():
    sources = Path(__file__).parents[3] / "dsc" / "validation"
    others = {
        "candidates.py",
        "emissions.py",
        "names.py",
        "review.py",
        "skill_types.py",
        "turns.py",
    }  # see test_review, test_turns_review, and test_checking of robots
    elsewhere = {"ignore", "known-object"}  # see test_ignored and test_known_objects
    files = [file for file in sources.glob("*.py") if file.name not in others]
    assert codes_in(files) == {case[0] for case in WRONG} | elsewhere


RIGHT = [
    S + "  a: {on: {done: e}}\n" + E,
    ITEM + "  a:\n" + GRASP + WIRED + E,
    # a composite around handles outcomes
    ITEM + "  c:\n    on: {failed: e, lost: e}\n    states: {a: {use: grasp, with: {item: ?item}, on: {done: a}}}\n" + E,
    # rules handle outcomes
    ITEM + "  a:\n" + GRASP + "    on: {done: e}\n" + E + "rules:\n  - {on: lost, do: {then: e}}\n  - {on: failed, do: {then: continue}}\n",
    # a rule with a limit and a last one without
    ITEM + "  a:\n" + GRASP + "    on: {done: e, failed: e}\n" + E
    + "rules:\n  - {on: lost, do: {then: retry, limit: 2}}\n  - {on: lost, do: {then: e}}\n",
    # a rule for the steps of plans alone
    S + "  a:\n    goal: (free)\n    on: {done: e, no_plan: e, gave_up: e}\n" + E
    + "rules:\n  - {on: failed, when: (= (failures ?event.item) 0), do: {then: retry}}\n",
    # events from outside, from skills under another name, local ones
    "plot: p\nreceives: {go: {where: place}}\nstates:\n  a:\n    on:\n      go: {to: b, when: (exists (?i - item) (on ?i ?event.where))}\n"
    "  b: {entry: {trigger: arm.grasp, with: {item: cup}, as: {grasped: ok}}, on: {ok: e, slipped: {to: e, emit: mine}, mine: e}}\n"
    .replace("item: cup", "item: ?i").replace("states:", "parameters: {i: item}\nstates:") + E,
    # a plot that never ends silently needs no `done`
    S + "  a: {use: talk, on: {said: e}}\n" + E,
    # a choice may lead back
    S + "  a: {use: choice, on: {done: e}}\n" + E,
    # a response to the steps of a plan leads to a state
    S + "  a:\n    goal: (free)\n    on: {done: e, no_plan: e, gave_up: e}\n  help: {use: wait, on: {done: e}}\n" + E
    + "rules:\n  - {on: failed, do: {then: help}}\n",
    # words are things, text and symbols alike; a variable may hold a thing of a type below
    "plot: p\nparameters: {o: object, w: {type: symbol, default: up}}\nvariables: {t: {type: text, initial: any text}}\nstates:\n"
    "  a: {use: grasp, with: {item: ?o, speed: (+ 1 2)}, on: {done: {to: e, assign: {t: ?w}}, failed: e, lost: e}}\n" + E,
    # a plot in a variable may end with anything
    "plot: p\nvariables: {plan: plot}\nstates:\n  a: {use: ?plan, on: {done: e, whatever: e}}\n" + E,
    # connectors: first, one after the other, fed by any event, on the way to an outcome that is fired before
    "plot: p\nemits: {yes: , no: }\nparameters: {i: item}\nstates:\n  first: {choice: [{when: (free), to: a}, second]}\n"
    "  second: {select: ?i, cases: {cup: a, can: {to: a, when: (free)}}, else: {to: e, emit: no}}\n"
    "  a: {entry: {trigger: arm.grasp, with: {item: ?i}}, on: {grasped: {to: over, emit: yes}, slipped: which}}\n"
    "  which: {select: ?event.item, cases: {cup: a}, else: {to: over, emit: no}}\n  over: {choice: [e]}\n" + E,
    # a rule may lead to a connector
    ITEM + "  a:\n" + GRASP + "    on: {done: e, failed: e}\n  c: {choice: [{when: (free), to: a}, e]}\n" + E
    + "rules:\n  - {on: lost, do: {then: c}}\n",
    # least times, periods, breaks
    S + "  a:\n    at_least: 2\n    after: [{seconds: 2, to: e}, {seconds: (* 2 3), to: e}]\n    on_break: {switch: arm, to: rest}\n"
    "    every: {seconds: 0.1, when: (free), tell: (not (free))}\n" + E,
    # histories are cleared where they are, or at any level below; those in regions belong to the orthogonal state
    H + "  a:\n    on: {out: {to: e, clear: [b, 'a*', o]}}\n    states:\n      b: {states: {c: {}, h: {history: deep, to: c}}}\n"
    "      o: {regions: {r: {states: {d: {}, i: {history: shallow, to: d}}}}}\n" + E,
    # what a plot needs is passed on every way in; what it has put out is there when it is done
    ITEM + "  a:\n    on:\n      done: {to: s, pass: {item: ?item}}\n"
    "  s: {use: search, on: {done: {to: b, pass: {place: ?event.where}, assign: {n: ?event.tries}}}}\n"
    "  b: {dynamic: [search, ask], with: {item: ?item}, on: {nobody: e, no_candidate: e, done: [{to: s, when: (on ?item ?event.where),\n"
    "    pass: {item: ?item}}, e]}}\n" + E + "variables: {n: number}\n",
    # the outputs of a plot in a variable are anybody's guess
    "plot: p\nvariables: {plan: plot, n: text}\nstates:\n  a: {use: ?plan, on: {done: {to: e, assign: {n: ?event.what}}}}\n" + E,
    # outcomes of plans may be passed on
    "plot: p\nemits: {no_plan: {reason: text}, gave_up: {reason: text}}\nstates:\n  a:\n    goal: (free)\n    on:\n      done: e\n"
    "      no_plan: {to: e, emit: no_plan, with: {reason: ?event.reason}}\n"
    "      gave_up: {to: e, emit: gave_up, with: {reason: ?event.reason}}\n" + E,
]  # fmt: skip


@pytest.mark.parametrize("text", RIGHT)
def test_a_right_plot_gets_none(text):
    assert [str(finding) for finding in findings_of(text)] == []


def test_without_schema_and_skills_the_rest_is_still_checked():
    text = "plot: p\nwhen: (whatever ?x)\nstates:\n  a: {entry: {trigger: any.thing}, on: {ok: ende}}\n" + E.replace(
        "e:", "end:"
    )
    findings = findings_of(text, None, None)
    assert [finding.code for finding in findings] == ["target"]


def test_findings_about_structure_come_first_and_alone():
    text = ITEM + "  a:\n" + GRASP + "    on: {done: nowhere}\n" + E
    assert {finding.code for finding in findings_of(text)} == {"target"}


def test_all_findings_of_a_library_are_raised_as_one_error_a_line_each():
    one = parse_plot(S + "  a: {on: {done: b}}\n" + E, "one.yaml")
    two = parse_plot("plot: q\nstates:\n  a: {on: {done: c, error: d}}\n" + E, "two.yaml")
    findings = validate_library(Library([one, two, *HELPERS]), SCHEMA, SKILLS)
    with pytest.raises(PlotError) as caught:
        raise_findings(findings)
    lines = str(caught.value).splitlines()
    assert len(lines) == len(caught.value.findings) == 3
    assert [line.split(":")[0] for line in lines] == ["one.yaml", "two.yaml", "two.yaml"]
    assert caught.value.place == findings[0].place
    raise_findings([])


def test_the_helpers_of_these_tests_are_right_themselves():
    assert [str(f) for f in validate_library(Library(HELPERS), SCHEMA, None)] == []


def test_the_shipped_plots_pass_without_skills():
    root = Path(__file__).parents[3]
    library = load_library(root / "domains" / "clean_up_table" / "plots")
    schema = Schema.from_pddl(root / "domains" / "clean_up_table" / "domain.pddl")
    assert [str(f) for f in validate_library(library, schema, None)] == []


def _ring(size):
    states = {f"s{n}": {"on": {"next": [{"to": f"s{(n + 1) % size}", "when": "(> ?n 0)"}]}} for n in range(size)}
    return {"plot": "ring", "variables": {"n": "number"}, "receives": {"next": None}, "states": states}


def _handed_on(size):
    """Submachines one after the other, each with a choice before it that passes what the plot inside needs."""
    states: dict[str, dict[str, object]] = {}
    for n in range(size):
        states[f"c{n}"] = {
            "choice": [{"to": f"c{n + 1}", "when": "(> ?n 0)"}, {"to": f"s{n}", "pass": {"item": "?item"}}]
        }
        states[f"s{n}"] = {"use": "search", "on": {"done": {"to": f"c{n + 1}", "assign": {"out": 1}}}}
    states[f"c{size}"] = {"select": "?n", "cases": {1: "e"}, "else": "e"}
    more = {
        "parameters": {"item": "item"},
        "variables": {"n": {"type": "number", "initial": 1}},
        "outputs": {"out": "number"},
    }
    return {"plot": "handed_on", **more, "states": {"begin": {"on": {"done": "c0"}}, **states, "e": {"final": True}}}


def _remembering(size):
    """Composite states with histories, which transitions forget."""
    states = {
        f"s{n}": {
            "initial": f"a{n}", "after": {"seconds": 1, "to": f"h{(n + 1) % size}", "clear": [f"s{n}", f"s{n}*"]},
            "states": {f"a{n}": {"on": {"go": f"b{n}"}}, f"b{n}": {}, f"h{n}": {"history": "deep", "to": f"b{n}"}},
        }
        for n in range(size)
    }  # fmt: skip
    return {"plot": "remembering", "dialect": "scxml", "states": states}


@pytest.mark.parametrize("form", [_ring, _handed_on, _remembering])
def test_a_large_plot_is_walked_no_oftener_than_a_small_one(form, monkeypatch):
    def walks(size):
        large = ActionPlot.model_validate(form(size))
        seen = []
        walk = ActionPlot.walk
        library = Library([*HELPERS, large])

        def noted(self):
            seen.append(self)
            return walk(self)

        monkeypatch.setattr(ActionPlot, "walk", noted)
        assert validate_plot(large, library, SCHEMA) == []
        monkeypatch.undo()
        return len(seen)

    assert walks(40) == walks(4)
