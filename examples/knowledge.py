"""The knowledge base from Python: declare in PDDL, change in transactions, ask, listen, explain."""

from knowledge_base import InputError, KnowledgeBase, Schema

SCHEMA = Schema.parse("""
(define (domain kitchen)
  (:types thing surface - object cup bowl - thing)
  (:predicates (on ?t - thing ?s - surface) (clean ?t - thing))
  (:functions (temperature ?t - thing)))
""")


def main() -> None:
    kb = KnowledgeBase(SCHEMA)
    kb.subscribe(lambda change: print(f"version {change.version} by {change.author}: {len(change.delta.added)} facts"))

    with kb.transaction(author="perception") as world:
        world.add_node("table", "surface")
        for name, kind in {"mug": "cup", "glass": "cup", "dish": "bowl"}.items():
            world.add_node(name, kind)
            world.tell("on", name, "table")
        world.tell("clean", "mug")
        world.set("temperature", "mug", 61.5)

    # A free variable asks for its values; a type is a predicate.
    print(kb.query("(and (on ?x table) (cup ?x) (not (clean ?x)))"))
    # Values enter through parameters, never by formatting text.
    print(kb.ask("(> (temperature ?cup) 60)", {"cup": "mug"}))
    all_clean = kb.explain("(forall (?c - cup) (clean ?c))")
    print(all_clean.truth, "because", all_clean.deciding)

    # A transaction that fails leaves nothing behind.
    try:
        with kb.transaction(author="me") as world:
            world.tell("clean", "glass")
            world.tell("claen", "dish")
    except InputError as error:
        print(error)
    print(kb.version, kb.ask("(clean glass)"))

    # The store is a networkx graph: things are nodes, binary facts arcs, unary facts self-arcs.
    print(sorted(kb.graph.successors("mug")))


if __name__ == "__main__":
    main()

# Expected output:
# version 1 by perception: 4 facts
# [{'x': 'glass'}]
# True
# False because (clean glass) is false
# there is no predicate 'claen'; did you mean 'clean'?
# 1 False
# ['mug', 'table']
