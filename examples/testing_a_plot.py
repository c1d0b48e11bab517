"""Tests of a plot without its robot: rehearse it, answer it by hand, replace a branch, see what was missed."""

from typing import NewType

from dsc import Component, Library, Outcome, SkillCall, parse_plot, skill
from dsc.testing import Answer, Coverage, DryRun, ends_with, rehearse, started, told, took, world

DOMAIN = """
(define (domain bar)
  (:types drink guest)
  (:predicates (has ?g - guest ?d - drink) (sold-out ?d - drink)))
"""

SERVE = parse_plot(
    """
plot: serve
parameters: {drink: drink, guest: guest}
receives: {last_orders: }
emits: {disappointed: {guest: guest}}
states:
  mix:
    use: mix
    with: {drink: ?drink}
    on: {done: hand_over, out_of_stock: sorry}
  hand_over:
    entry: {trigger: arm.hand, with: {to: ?guest}, within: 30}
    on:
      taken: {to: served, tell: (has ?guest ?drink)}
      timed_out: sorry
  sorry:
    always: {to: served, emit: disappointed, with: {guest: ?guest}}
  served: {final: true}
rules:
  - on: spilled
    do: {then: retry, limit: 2}
  - on: spilled
    do: {then: sorry}
""",
    "serve.yaml",
)

MIX = parse_plot(
    """
plot: mix
parameters: {drink: drink}
emits: {spilled: , out_of_stock: {drink: drink}}
states:
  pour:
    entry: {trigger: arm.pour, with: {drink: ?drink}}
    on:
      poured: ready
      spilled: {to: ended, emit: spilled}
      empty: {to: ended, tell: (sold-out ?drink), emit: out_of_stock, with: {drink: ?drink}}
  ready: {final: true}
  ended: {final: true}
""",
    "mix.yaml",
)

LIBRARY = Library([SERVE, MIX])
coverage = Coverage(LIBRARY)


Drink = NewType("Drink", str)
Guest = NewType("Guest", str)


class Poured(Outcome): ...


class Spilled(Outcome): ...


class Empty(Outcome): ...


class Taken(Outcome): ...


class Arm(Component):
    """The real one. Tests only take its word for what it can do, and end with."""

    name = "arm"

    @skill
    async def pour(self, call: SkillCall, drink: Drink) -> Poured | Spilled | Empty:
        raise NotImplementedError

    @skill
    async def hand(self, call: SkillCall, to: Guest) -> Taken:
        raise NotImplementedError


def bar():
    return world(DOMAIN, "mojito - drink ann - guest")


ORDER = {"drink": "mojito", "guest": "ann"}


def test_a_drink_that_is_spilled_is_mixed_again():
    run = rehearse(
        LIBRARY, "serve", ORDER, knowledge=bar(), like=[Arm()],
        skills={"arm.pour": ["spilled", Answer("poured", after=20)], "arm.hand": Answer("taken", after=3)},
    )  # fmt: skip
    assert took(run, "mix", rule="spilled: retry")
    assert started(run, "arm.hand", to="ann")
    assert run.knowledge.ask("(has ann mojito)")
    assert run.seconds == 24  # simulated; the test itself takes milliseconds
    coverage.add(*run.steps)


def test_nobody_waits_for_ever_for_a_guest():
    run = DryRun(LIBRARY, "serve", ORDER, bar())
    run.answer("arm.pour", "poured")
    assert run.active == ("hand_over",)
    assert run.advance(29) == ()
    run.advance(1)
    assert [event.name for event in run.emitted] == ["disappointed"]
    coverage.add(*run.steps)


def test_serving_does_not_care_how_mixing_ends_well():
    substituted = ends_with(MIX, after=5)  # no arm pours anything here
    run = rehearse(
        LIBRARY.substitute("mix", substituted), "serve", ORDER, knowledge=bar(), skills={"arm.hand": "taken"}
    )
    assert [call.skill for call in run.calls] == ["arm.hand"]
    assert told(run, "(has ann mojito)")
    coverage.add(*run.steps)  # counts for `serve`; what stood in for `mix` does not count for `mix`


def main() -> None:
    for name, test in list(globals().items()):
        if name.startswith("test_"):
            test()
            print("passed", name)
    print(coverage.report())


if __name__ == "__main__":
    main()

# Expected output:
# passed test_a_drink_that_is_spilled_is_mixed_again
# passed test_nobody_waits_for_ever_for_a_guest
# passed test_serving_does_not_care_how_mixing_ends_well
#             states  transitions        rules
# serve       4 of 4       4 of 5       1 of 2
#   serve.yaml:10:27: 'mix' never took out_of_stock -> sorry
#   serve.yaml:22:5: rule 'spilled: sorry' never answered
# mix         3 of 3       2 of 3            -
#   mix.yaml:11:7: 'pour' never took empty -> ended
