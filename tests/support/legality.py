"""What a legal state of a machine is (SCXML 3.11, with plots inside plots)."""

from __future__ import annotations

from dsc.model.states import SubmachineState
from dsc.model.transitions import Connector


def check_legal(frame):
    """One child of every composite, all regions, everything around active, plots in active hosts alone."""
    nodes, index = frame.compiled.nodes, frame.compiled.index
    active = frame.configuration.members
    for node in nodes:
        if node.index == 0 or node.index in active:
            inside = [child for child in node.children if child in active]
            assert len(inside) == (len(node.children) if node.orthogonal else min(1, len(node.children)))
            assert not isinstance(node.state, Connector), "something rests in a connector"
        else:
            assert not active & set(node.children)
    hosts = {name for name in frame.active if isinstance(nodes[index[name]].state, SubmachineState)}
    assert set(frame.children) == hosts
    for child in frame.children.values():
        check_legal(child)


def check_serials(state):
    """Numbers are given out once, to active states only."""
    serials = [*_serials(state.root)]
    assert len(serials) == len(set(serials))
    assert max(serials) <= state.serials


def _serials(frame):
    yield frame.serial
    assert set(frame.activations) <= set(frame.configuration.names)
    yield from frame.activations.values()
    for child in frame.children.values():
        yield from _serials(child)
