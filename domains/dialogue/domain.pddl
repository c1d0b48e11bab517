; Arcs that speak and ask (S4.5). The first agent speaks.
(define (domain dialogue)
  (:types agent)
  (:predicates
    (say ?from ?to - agent ?words - text)
    (ask ?from ?to - agent ?topic - text)
    (reply ?from ?to - agent ?topic ?answer - text)
    (unanswered ?from ?to - agent ?topic ?reason - text)
    (listen ?who - agent)
    (heard ?who - agent ?words - text)
    (pending ?from ?to - agent ?topic - text ?until - number))) ; second of the run at which the question is retracted
