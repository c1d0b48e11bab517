; What the planner knows. Predicates are facts of the knowledge base; plots and skills use the same names.
(define (domain delivery)
  (:requirements :strips :typing)
  (:types room parcel)
  (:predicates
    (robot-in ?r - room)
    (lies-in ?p - parcel ?r - room)
    (belongs-in ?p - parcel ?r - room)
    (carries ?p - parcel)
    (empty))

  (:action drive
    :parameters (?from ?to - room)
    :precondition (robot-in ?from)
    :effect (and (not (robot-in ?from)) (robot-in ?to)))

  (:action pick-up
    :parameters (?parcel - parcel ?room - room)
    :precondition (and (robot-in ?room) (lies-in ?parcel ?room) (empty))
    :effect (and (not (lies-in ?parcel ?room)) (not (empty)) (carries ?parcel)))

  (:action put-down
    :parameters (?parcel - parcel ?room - room)
    :precondition (and (robot-in ?room) (carries ?parcel))
    :effect (and (not (carries ?parcel)) (empty) (lies-in ?parcel ?room))))
