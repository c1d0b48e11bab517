"""Charts that await everything there is to await, for runs that are broken off."""

from __future__ import annotations

from dsc.events import Event
from knowledge_base.facts import Delta, Fact

CHARTS = {
    "one skill after the other": """
        plot: p
        states:
          a: {entry: [{trigger: robot.work}], on: {did: b}}
          b: {entry: [{set: robot.speed, to: 3}, {switch: robot, to: careful}, {trigger: robot.work, with: {seconds: 1.5, observes: q}}], on: {did: e}}
          e: {final: true}
    """,
    "variables, tells and guards": """
        plot: p
        variables: {n: {type: number, initial: 0}}
        states:
          a: {entry: [{trigger: robot.work}], on: {did: [{to: b, when: (and (= ?n 2) (told)), assign: {n: ?event.n}}, {to: a, assign: {n: (+ ?n 1)}, tell: (told)}]}}
          b: {entry: [{trigger: robot.work, with: {seconds: (+ ?n 1)}}], on: {did: e}}
          e: {final: true}
    """,
    "timeouts, periods and a least time": """
        plot: p
        variables: {n: {type: number, initial: 0}}
        states:
          a:
            entry: [{trigger: robot.work, with: {seconds: 50}}]
            every: {seconds: 1, assign: {n: (+ ?n 1)}}
            after: {seconds: 5.5, to: b}
          b:
            at_least: 4
            entry: [{trigger: robot.work, with: {seconds: 1}}]
            on: {did: e}
          e: {final: true}
    """,
    "reports on the way": """
        plot: p
        variables: {n: {type: number, initial: 0}}
        states:
          a:
            entry: [{trigger: robot.work, with: {reports: 3}}]
            on: {progress: {assign: {n: (+ ?n 1)}}, did: [{to: e, when: (= ?n 3)}, wrong]}
          wrong:
          e: {final: true}
    """,
    "what a skill sees on the way": """
        plot: p
        states:
          a: {entry: [{trigger: robot.work, with: {reports: 1, sees: true}}], always: {to: b, when: (q)}, on: {did: wrong}}
          b: {entry: [{trigger: robot.work, with: {reports: 1, sees: true}}], on: {did: e}}
          wrong:
          e: {final: true}
    """,
    "two regions": """
        plot: p
        states:
          both:
            regions:
              left: {states: {a: {entry: [{trigger: robot.work, with: {seconds: 2}}], on: {did: b}}, b: {entry: [{trigger: robot.work, with: {seconds: 2.5}}], on: {did: c}}, c: {final: true}}}
              right: {states: {d: {entry: [{trigger: robot.work, with: {seconds: 3}}], on: {did: f}}, f: {final: true}}}
            on: {done: e}
          e: {final: true}
    """,
    "a plot that is a value": """
        plot: p
        variables: {made: plot}
        states:
          a: {entry: [{trigger: robot.plan}], on: {planned: {to: b, assign: {made: ?event.plot}}}}
          b: {use: ?made, entry: [{trigger: robot.work, with: {seconds: 9}}], on: {done: c, did: c}}
          c: {entry: [{trigger: robot.work}], on: {did: e}}
          e: {final: true}
    """,
    "an outcome of the plot": """
        plot: p
        emits: {half: {n: number}}
        states:
          a: {entry: [{trigger: robot.work}], on: {did: {to: b, emit: half, with: {n: ?event.n}}}}
          b: {entry: [{trigger: robot.work}], on: {did: e}}
          e: {final: true}
    """,
    "events that the chart sends itself later": """
        plot: p
        dialect: scxml
        states:
          a:
            entry: [{emit: late, delay: 5, id: one}, {emit: late, delay: 5, id: two}, {emit: later, delay: 7}, {trigger: robot.work}]
            on: {did: {to: b, do: [{withdraw: one}]}}
          b: {on: {late: c}}
          c: {on: {late: wrong, later: e}}
          wrong: {final: true, entry: [{tell: (told)}]}
          e: {final: true}
    """,
    "skills that wait for their turn": """
        plot: p
        states:
          all:
            regions:
              one: {states: {a: {entry: {trigger: robot.work, with: {seconds: 3}}, on: {did: ae}}, ae: {final: true}}}
              two: {states: {b: {entry: {trigger: robot.work, with: {seconds: 1}}, on: {did: be}}, be: {final: true}}}
              three:
                states:
                  c: {after: {seconds: 1, to: d}}
                  d: {priority: 2, entry: {trigger: robot.work, with: {seconds: 2}}, on: {did: ce}}
                  ce: {final: true}
              four:
                states:
                  f: {after: {seconds: 4, to: g}}
                  g: {priority: 3, preempt: true, entry: {trigger: robot.work}, on: {did: fe}}
                  fe: {final: true}
            on: {done: e}
          e: {final: true}
    """,
    "a problem at the end": """
        plot: p
        states:
          a: {entry: [{trigger: robot.work}], exit: [{set: robot.power, to: 0}], on: {did: b}}
          b: {entry: [{trigger: robot.work}], exit: [{set: robot.power, to: 0}], on: {progress: a}}
    """,
}


def handed_in(sequencer):
    sequencer.post(Event("go", {"n": 1}), after=3)
    sequencer.change(Delta(added=(Fact("q"),)), "somebody", after=6)
    sequencer.post(Event("go", {"n": 2}), after=9)
