(define (domain butler)
  (:types room furniture - location location item)
  (:constants hall - room)
  (:predicates
    (robot-at ?l - location)
    (item-at ?i - item ?l - location)
    (holding ?i - item)
    (has-person ?i - item))
  (:functions (x ?l - location) (y ?l - location) - number)
  (:action go
    :parameters (?from ?to - location)
    :precondition (robot-at ?from)
    :effect (and (robot-at ?to) (not (robot-at ?from))))
  (:action take
    :parameters (?item - item ?at - location)
    :precondition (and (robot-at ?at) (item-at ?item ?at) (forall (?other - item) (not (holding ?other))))
    :effect (and (holding ?item) (not (item-at ?item ?at))))
  (:action give
    :parameters (?item - item)
    :precondition (and (holding ?item) (robot-at hall))
    :effect (and (has-person ?item) (not (holding ?item)))))
