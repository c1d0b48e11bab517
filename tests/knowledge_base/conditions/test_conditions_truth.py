"""Installed conditions are, at every version, what evaluating them anew would say: truth, witnesses, firings."""

from __future__ import annotations

import contextlib
from typing import Literal

from hypothesis import given, settings
from hypothesis import strategies as st
from kb_random_schemas import brute_witnesses, changes, conditions, languages, parameters
from kb_strategies import brute

from knowledge_base import Delta, KnowledgeBase
from knowledge_base.errors import InputError
from knowledge_base.language.syntax import expression as ex

PROPERTY = settings(deadline=None, derandomize=True, max_examples=60)


class UndoneError(Exception):
    pass


class Model:
    """A condition evaluated anew at every version."""

    def __init__(self, e, params, fire, world):
        self.e, self.params, self.fire = e, params, fire
        self.witnesses = brute_witnesses(e, params, world)

    def step(self, world):
        """What those who hear falls too are told: whether it is true, or nothing."""
        was, self.witnesses = self.witnesses, brute_witnesses(self.e, self.params, world)
        if bool(was) != bool(self.witnesses):
            return [bool(self.witnesses)]
        return [True] if self.fire == "each" and was != self.witnesses else []


def commit(kb, deltas, *, rolled_back) -> None:
    with contextlib.suppress(UndoneError), kb.transaction(author="test") as tx:
        for delta in deltas:
            with contextlib.suppress(InputError):  # about a thing that was removed
                tx.apply(delta)
        if rolled_back:
            raise UndoneError


@PROPERTY
@given(st.data())
def test_truth_and_firings_are_those_of_evaluating_anew_in_order(data) -> None:
    language = data.draw(languages())
    kb = KnowledgeBase(language.schema)
    kb.apply(Delta(nodes=language.things), author="test")
    commit(kb, [data.draw(changes(language))], rolled_back=False)
    heard, expected, installed = [], [], []

    def install(number) -> None:
        e = data.draw(conditions(language))
        params = data.draw(parameters(e, language.schema))
        # What an outermost `exists` chooses is part of the witness, so the set of witnesses is another one.
        fire: Literal["edge", "each"] = (
            "edge" if isinstance(e, ex.Exists) else data.draw(st.sampled_from(["edge", "each"]))
        )
        try:
            condition = kb.install(e, params, fire=fire)
        except InputError:  # about a thing that was removed
            return
        condition.subscribe(lambda f: heard.append((f.version, number, f.truth)), falls=True)
        installed.append((number, condition, Model(e, params, fire, kb)))

    for number in range(data.draw(st.integers(1, 6))):
        install(number)
        before = kb.version
        commit(kb, data.draw(st.lists(changes(language), min_size=1, max_size=2)),
               rolled_back=data.draw(st.integers(0, 4)) == 0)  # fmt: skip
        for which, condition, model in installed:
            if kb.version > before:
                expected += [(kb.version, which, truth) for truth in model.step(kb)]
            assert condition.truth == bool(model.witnesses)
            assert (condition.witness is not None) == condition.truth
            if condition.truth:
                witness = {n: v for n, v in condition.witness.items() if n in ex.free_variables(model.e)}
                assert brute(model.e, kb, {**model.params, **witness})
        assert heard == expected
    for _, condition, _ in installed:
        condition.cancel()
    assert not kb._installed._joins
    assert not any(kb._installed._readers.values())
