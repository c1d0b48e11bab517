; The conversation; the door, the persons and the base have their parts of the domain in their classes.
(define (domain conversation)
  (:types person - agent agent floor)
  (:constants robot - agent floor0 floor1 floor2 floor3 floor4 - floor)
  (:predicates (inside) (in-lift ?p - person) (looks-at ?who ?what - object) (door-open) (floor-known)
    (at-floor ?who - agent ?f - floor) (assigned ?who - agent ?f - floor))
  (:action ask-for-floor ; the answer may be another floor
    :parameters (?person - person ?floor - floor)
    :precondition (and (inside) (door-open) (not (floor-known)) (in-lift ?person) (looks-at robot ?person))
    :effect (and (at-floor robot ?floor) (floor-known))))
