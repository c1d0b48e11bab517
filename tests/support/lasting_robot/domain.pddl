(define (domain delivery)
  (:requirements :strips :typing)
  (:types room parcel)
  (:predicates (cart-in ?room - room) (lies-in ?parcel - parcel ?room - room) (wanted-in ?parcel - parcel ?room - room)
               (loaded ?parcel - parcel) (empty))
  (:action drive
    :parameters (?from ?to - room)
    :precondition (cart-in ?from)
    :effect (and (not (cart-in ?from)) (cart-in ?to)))
  (:action load
    :parameters (?parcel - parcel ?room - room)
    :precondition (and (cart-in ?room) (lies-in ?parcel ?room) (empty))
    :effect (and (not (lies-in ?parcel ?room)) (not (empty)) (loaded ?parcel)))
  (:action unload
    :parameters (?parcel - parcel ?room - room)
    :precondition (and (cart-in ?room) (loaded ?parcel))
    :effect (and (not (loaded ?parcel)) (empty) (lies-in ?parcel ?room))))
