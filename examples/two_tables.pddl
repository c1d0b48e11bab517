; Two robots, each with a table of its own to clear, and one bin between them whose lid has to be opened first and
; closed in the end. The names are those of the clean-up table.
(define (domain two-tables)
  (:requirements :strips :typing)
  (:types robot item place - object
          table bin - place)
  (:predicates
    (robot-at ?robot - robot ?place - place)
    (reaches ?robot - robot ?place - place)
    (hand-free ?robot - robot)
    (holding ?robot - robot ?item - item)
    (lies-at ?item - item ?table - table)
    (open ?bin - bin)
    (closed ?bin - bin)
    (disposed ?item - item))

  (:action drive
    :parameters (?robot - robot ?start ?to - place)
    :precondition (and (robot-at ?robot ?start) (reaches ?robot ?to))
    :effect (and (not (robot-at ?robot ?start)) (robot-at ?robot ?to)))

  (:action pick-up
    :parameters (?robot - robot ?item - item ?table - table)
    :precondition (and (robot-at ?robot ?table) (hand-free ?robot) (lies-at ?item ?table))
    :effect (and (not (hand-free ?robot)) (not (lies-at ?item ?table)) (holding ?robot ?item)))

  (:action throw-away
    :parameters (?robot - robot ?item - item ?bin - bin)
    :precondition (and (robot-at ?robot ?bin) (holding ?robot ?item) (open ?bin))
    :effect (and (not (holding ?robot ?item)) (hand-free ?robot) (disposed ?item)))

  (:action open-lid
    :parameters (?robot - robot ?bin - bin)
    :precondition (and (robot-at ?robot ?bin) (hand-free ?robot) (closed ?bin))
    :effect (and (not (closed ?bin)) (open ?bin)))

  (:action close-lid
    :parameters (?robot - robot ?bin - bin)
    :precondition (and (robot-at ?robot ?bin) (hand-free ?robot) (open ?bin))
    :effect (and (not (open ?bin)) (closed ?bin))))
