"""Rooms, things and a robot that carries them: the domain of what goes wrong while a plan is carried out."""

import asyncio

from planning import PlanningDomain

DOMAIN = PlanningDomain.parse("""
(define (domain errands)
  (:types room thing)
  (:predicates (at ?r - room) (in ?t - thing ?r - room) (holding ?t - thing) (way ?a ?b - room) (clean ?r - room))
  (:action go :parameters (?from ?to - room) :precondition (and (at ?from) (way ?from ?to))
    :effect (and (not (at ?from)) (at ?to)))
  (:action take :parameters (?t - thing ?r - room) :precondition (and (at ?r) (in ?t ?r)) :effect (and (not (in ?t ?r)) (holding ?t)))
  (:action put :parameters (?t - thing ?r - room) :precondition (and (at ?r) (holding ?t)) :effect (and (not (holding ?t)) (in ?t ?r)))
  (:action sweep :parameters (?r - room) :precondition (at ?r) :effect (clean ?r)))
""")
HOLDER = """
plot: errand
receives: {stop: }
emits: {ended: {how: text}}
states:
  work:
    on: {stop: {to: over, emit: ended, with: {how: stopped}}, done: over}
    states:
      doing:
        goal: GOAL
        budget: {replans: REPLANS, seconds: 5}
        on:
          done: {to: did, emit: ended, with: {how: reached}}
          no_plan: {to: did, emit: ended, with: {how: ?event.reason}}
          gave_up: {to: did, emit: ended, with: {how: ?event.reason}}
      did: {final: true}
  over: {final: true}
"""
ROOMS = ("a", "b", "c", "d")
ROUND = ("a b", "b c", "c d", "d a", "b a", "c b", "d c", "a d")


def when_asked(act):
    """To prepare a run: let `act` go on with its sequencer as soon as a plan is asked for."""

    def prepare(sequencer):
        def look(record):
            if record.type == "plan.asked":
                asyncio.get_running_loop().create_task(act(sequencer))

        sequencer.trace.listen(look)

    return prepare
