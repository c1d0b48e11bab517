; The flat; locations, items and the actions of a robot that fetches are in fetch-skills.
(define (domain butler)
  (:types room furniture - location location item)
  (:constants hall - room)
  (:predicates
    (robot-at ?l - location)
    (holding ?i - item)
    (has-person ?i - item))
  (:action give
    :parameters (?item - item)
    :precondition (and (holding ?item) (robot-at hall))
    :effect (and (has-person ?item) (not (holding ?item)))))
