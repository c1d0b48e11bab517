"""Step 7, a test: a rehearsal runs plots with scripted skills in simulated time, and its steps are compared."""

from step1_skill import Base
from step2_plot import DOMAIN, FETCH, Gripper

from dsc import Library, primitive_plot
from dsc.testing import emitted, entered, rehearse, world

LIBRARY = Library([FETCH, primitive_plot(Base().skills()["drive"], done="arrived")])
MAP = world(DOMAIN, "hall office - room letter - parcel", "(robot-in hall) (lies-in letter office)")
ARGUMENTS = {"parcel": "letter", "from": "hall", "to": "office"}


def test_a_parcel_is_fetched() -> None:
    run = rehearse(
        LIBRARY, "fetch", ARGUMENTS, knowledge=MAP, like=[Base(), Gripper()],
        skills={"base.drive": "arrived", "gripper.pick_up": "picked_up"},
    )  # fmt: skip
    assert run.finished
    assert entered(run, "grasp")


def test_a_missing_parcel_is_reported() -> None:
    run = rehearse(
        LIBRARY, "fetch", ARGUMENTS, knowledge=MAP, like=[Base(), Gripper()],
        skills={"base.drive": "arrived", "gripper.pick_up": "nothing_there"},
    )  # fmt: skip
    assert emitted(run, "missing")


if __name__ == "__main__":  # or: pytest step7_test.py
    test_a_parcel_is_fetched()
    test_a_missing_parcel_is_reported()
    print("2 passed")

# Expected output:
# 2 passed
