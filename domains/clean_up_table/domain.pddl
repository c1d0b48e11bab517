; Clean up a table: cups nest into cups and go to the sink; cans go into crisp cans and into the bin.
;
; Two modelling choices keep plans short under a planner without costs or negation:
; - an item is `tidy` as soon as it is stacked (its carrier still has to be thrown away), so stacking is
;   as good as throwing, and cheaper;
; - a carrier may be thrown away once its room is used up, or after a look shows that nothing more shall go
;   in (`check-room`, one unit of room a look). Throwing a carrier early thus costs looks, stacking does not.
(define (domain clean-up-table)
  (:requirements :strips :typing)
  (:types item place room - object
          cup can crisp-can - item
          surface destination - place)
  (:constants none one two - room)
  (:predicates
    (robot-at ?p - place)
    (hand-free)
    (holding ?i - item)
    (lies-at ?item - item ?surface - surface)
    (inside ?i ?carrier - item)
    (free-room ?carrier - item ?r - room)
    (one-less ?more ?less - room)
    (fits ?i ?carrier - item)
    (goes-to ?item - item ?destination - destination)
    (graspable ?i - item)
    (passable ?p - place)
    (seen ?i - item)
    (in-view ?i - item)         ; in the last look
    (missing ?i - item)
    (tidy ?i - item)
    (disposed ?i - item))

  (:functions
    (failures ?i - item)        ; failed grasps in a row
    (detours ?p - place))       ; failed drives to a place in a row

  (:action drive
    :parameters (?from ?to - place)
    :precondition (and (robot-at ?from) (passable ?to))
    :effect (and (not (robot-at ?from)) (robot-at ?to)))

  (:action pick-up
    :parameters (?item - item ?surface - surface)
    :precondition (and (robot-at ?surface) (hand-free) (lies-at ?item ?surface) (graspable ?item))
    :effect (and (not (hand-free)) (not (lies-at ?item ?surface)) (holding ?item)))

  (:action put-down
    :parameters (?item - item ?surface - surface)
    :precondition (and (robot-at ?surface) (holding ?item))
    :effect (and (not (holding ?item)) (hand-free) (lies-at ?item ?surface)))

  (:action stack
    :parameters (?item ?carrier - item ?more ?less - room ?surface - surface)
    :precondition (and (robot-at ?surface) (holding ?item) (lies-at ?carrier ?surface) (fits ?item ?carrier)
                       (free-room ?carrier ?more) (one-less ?more ?less) (graspable ?carrier))
    :effect (and (not (holding ?item)) (hand-free) (inside ?item ?carrier) (tidy ?item)
                 (not (free-room ?carrier ?more)) (free-room ?carrier ?less)))

  (:action take-out
    :parameters (?item ?carrier - item ?more ?less - room ?surface - surface)
    :precondition (and (robot-at ?surface) (hand-free) (lies-at ?carrier ?surface) (inside ?item ?carrier)
                       (free-room ?carrier ?less) (one-less ?more ?less) (graspable ?item))
    :effect (and (not (hand-free)) (holding ?item) (not (inside ?item ?carrier)) (not (tidy ?item))
                 (not (free-room ?carrier ?less)) (free-room ?carrier ?more)))

  (:action check-room
    :parameters (?carrier - item ?more ?less - room ?surface - surface)
    :precondition (and (robot-at ?surface) (hand-free) (lies-at ?carrier ?surface)
                       (free-room ?carrier ?more) (one-less ?more ?less))
    :effect (and (not (free-room ?carrier ?more)) (free-room ?carrier ?less)))

  (:action throw-away
    :parameters (?item - item ?destination - destination)
    :precondition (and (robot-at ?destination) (holding ?item) (goes-to ?item ?destination) (free-room ?item none))
    :effect (and (not (holding ?item)) (hand-free) (tidy ?item))))
