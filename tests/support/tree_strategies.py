"""Random files of behaviour trees as values, for properties."""

from __future__ import annotations

from types import MappingProxyType

from hypothesis import strategies as st

from dsc.trees import Node, NodeModel, Port, Tree, TreeFile
from dsc.trees.kinds import BOOLEAN, INTEGER, KEY, KINDS, NUMBER, SCRIPT, SCRIPTS, STATUS

NAMES = st.sampled_from(["cup", "hall", "über", "a b", 'quo"te', "<&>", "line\nend", "tab\t", "'one'"])
KEYS = st.sampled_from(["{item}", "{=}", "{@all}", "{place}"])
CODE = st.sampled_from(
    [
        "x := 1",
        "a = b + 1; c *= 2",
        "x < 3 && !(y == 'no')",
        "s := 'a' .. \"\"[:0]".replace(' .. ""[:0]', ""),
        "z > 1 ? 1 : 2",
    ]
)
TEXTS = {
    INTEGER: st.one_of(st.integers(-9, 99).map(str), KEYS),
    NUMBER: st.one_of(st.floats(-9, 99).map(str), KEYS),
    BOOLEAN: st.one_of(st.sampled_from(["true", "false", "0", "1"]), KEYS),
    SCRIPT: CODE,
    STATUS: st.sampled_from(["SUCCESS", "FAILURE", "SKIPPED", "RUNNING"]),
    KEY: st.one_of(st.just("item"), KEYS),
}
LEAVES = {"Grasp": "action", "Look": "action", "DoorOpen": "condition", "Plain": "leaf", "Bare": "leaf"}
MODELS = {
    "Look": NodeModel(
        "Look", "action", (Port("place", "input", "std::string", "hall", "a room"), Port("item", "output"))
    ),
    "DoorOpen": NodeModel("DoorOpen", "condition"),
    "Inner1": NodeModel("Inner1", "subtree", (Port("n", "inout", "int", "{n}", "a <number> & more"),)),
}


@st.composite
def nodes(draw, trees, depth):
    """A valid node; a subtree runs one of `trees`."""
    inner = [name for name, kind in KINDS.items() if kind.role != "subtree" and (depth > 0 or kind.most == 0)]
    kind = draw(st.sampled_from([*inner, *LEAVES, *(["SubTree"] if trees else [])]))
    scripts = MappingProxyType({name: draw(CODE) for name in SCRIPTS if draw(st.integers(0, 9)) == 0})
    name = draw(st.one_of(st.just(""), NAMES))
    if kind == "SubTree":
        ports = draw(st.dictionaries(st.sampled_from(["n", "item", "_autoremap"]), KEYS, max_size=2))
        ports = {key: "true" if key == "_autoremap" else text for key, text in ports.items()}
        return Node(kind, "subtree", name, draw(st.sampled_from(trees)), MappingProxyType(ports), scripts)
    if kind in LEAVES:
        ports = (
            {}
            if kind == "DoorOpen"
            else draw(st.dictionaries(st.sampled_from(["place", "item"]), NAMES | KEYS, max_size=2))
        )
        role = LEAVES[kind]
        return Node(kind, role, name, "", MappingProxyType(ports), scripts)  # type: ignore[arg-type]
    known = KINDS[kind]
    chosen = [port for port in known.ports.values() if port.default is None or draw(st.booleans())]
    ports = {port.name: draw(TEXTS.get(port.type, NAMES | KEYS)) for port in chosen}
    most = known.most if known.most is not None else 3
    children = [draw(nodes(trees, depth - 1)) for _ in range(draw(st.integers(known.least, max(most, known.least))))]
    return Node(kind, known.role, name, "", MappingProxyType(ports), scripts, tuple(children))


@st.composite
def files(draw):
    """A valid file; each tree may run the trees after it."""
    names = ["Main", *[f"Inner{number}" for number in range(1, draw(st.integers(1, 3)))]]
    trees = {name: Tree(name, draw(nodes(names[at + 1 :], 2))) for at, name in enumerate(names)}
    main = draw(st.sampled_from(names)) if len(names) == 1 else draw(st.sampled_from([None, *names]))
    return TreeFile(trees, main, MODELS)
