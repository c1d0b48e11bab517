; A kitchen, for trying `dsc kb`: dsc kb show examples/kitchen/problem.pddl
(define (domain kitchen)
  (:types thing surface - object cup bowl - thing)
  (:predicates (on ?t - thing ?s - surface) (clean ?t - thing))
  (:functions (temperature ?t - thing)))
