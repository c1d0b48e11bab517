; Arcs that request attention (S4.5).
(define (domain attention)
  (:predicates
    (want-see ?who ?what - object)
    (looks-at ?who ?what - object))
  (:functions
    (interest ?what - object)               ; how many looks an object is ahead of others, 0 without a value
    (looks ?who - object)                   ; number of looks so far
    (looked-at ?who ?what - object)))       ; number of the last look at an object
