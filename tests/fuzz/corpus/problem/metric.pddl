(define (problem p) (:domain kitchen) (:requirements :typing) (:objects c1 c2 - cup t - surface)
  (:init (on c1 t) (not (clean c1)) (= (temperature c1) 40)) (:goal (and (clean c1) (or (clean c2) (not (on c1 t)))))
  (:metric minimize (temperature c1)))
