; A robot that drives to locations, and carries one item at a time.
(define (domain fetch-skills)
  (:types location item)
  (:predicates
    (robot-at ?l - location)
    (item-at ?i - item ?l - location)
    (holding ?i - item))
  (:functions (position ?l - location) - geometry) ; x and y in metres
  (:action go
    :parameters (?from ?to - location)
    :precondition (robot-at ?from)
    :effect (and (robot-at ?to) (not (robot-at ?from))))
  (:action come ; from a point between locations, e.g. after a drive that was interrupted
    :parameters (?to - location)
    :precondition (forall (?l - location) (not (robot-at ?l)))
    :effect (robot-at ?to))
  (:action take
    :parameters (?item - item ?at - location)
    :precondition (and (robot-at ?at) (item-at ?item ?at) (forall (?other - item) (not (holding ?other))))
    :effect (and (holding ?item) (not (item-at ?item ?at))))
  (:action put
    :parameters (?item - item ?at - location)
    :precondition (and (robot-at ?at) (holding ?item))
    :effect (and (item-at ?item ?at) (not (holding ?item)))))
