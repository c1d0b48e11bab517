(define (domain more) (:types mug - cup) (:predicates (dirty ?i - item)) (:action wipe :parameters (?i - item) :precondition (holding ?i) :effect (dirty ?i)))
