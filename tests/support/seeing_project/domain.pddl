(define (domain seeing)
  (:types item place)
  (:constants shelf bin - place)
  (:predicates (in ?i - item ?p - place) (seen ?i - item)))
