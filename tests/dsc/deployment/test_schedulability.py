"""Schedulability: the tests of random task sets agree with their simulated schedules."""

from __future__ import annotations

import os
from collections import Counter
from random import Random

import pytest

from dsc.deployment import schedulability as tests
from dsc.deployment.schedule import Policy, random_jobs, run_jobs, worst_jobs
from dsc.deployment.tasks import Task, hyperperiod, utilisation
from knowledge_base.errors import InputError

SETS = int(os.environ.get("SETS", "1000"))
PERIODS = (4, 5, 6, 8, 10, 12, 15, 20, 24, 30, 40, 60)


def task(name: str, period: int, worst_case: int, deadline: int | None = None, **times: int) -> Task:
    return Task(name, period, worst_case, period if deadline is None else deadline, **times)


def random_tasks(random: Random) -> list[Task]:
    """Up to five tasks with distinct priorities; half of the sets have jitter or blocking."""
    number = random.randint(1, 5)
    load = random.uniform(0.4, 1.1)
    shares = [random.random() for _ in range(number)]
    extras = random.choice(("none", "none", "jitter", "blocking", "both"))
    priorities = random.sample(range(10), number)
    made = []
    for position, share in enumerate(shares):
        period = random.choice(PERIODS)
        worst_case = max(1, min(period, round(period * load * share / sum(shares))))
        deadline = random.choice((period, random.randint(worst_case, period), random.randint(period, 3 * period)))
        jitter = random.randint(0, period // 2) if extras in {"jitter", "both"} else 0
        blocking = random.randint(0, period // 3) if extras in {"blocking", "both"} else 0
        made.append(Task(f"t{position}", period, worst_case, deadline, jitter, blocking, priorities[position]))
    return made


def horizon(tasks: list[Task]) -> int:
    """A time within which each task set that can miss a deadline in its worst case does so."""
    longest = hyperperiod(tasks) + max(one.deadline + one.jitter for one in tasks)
    over = utilisation(tasks) - 1
    return 2 * longest if over <= 0 else 2 * longest + int(sum(one.deadline for one in tasks) / over)


def schedulable(tasks: list[Task], policy: Policy) -> bool:
    if policy == "earliest_deadline":
        return tests.overload(tasks) is None
    others = [(one, [other for other in tasks if other is not one]) for one in tasks]
    worst = [(one, tests.response_time(one, rest)) for one, rest in others]
    return all(found is not None and found <= one.deadline for one, found in worst)


@pytest.mark.parametrize("policy", ["fixed_priority", "earliest_deadline"])
def test_random_task_sets_agree_with_their_schedules(policy: Policy):
    random = Random(7)  # noqa: S311  a simulation
    seen: Counter[tuple[bool, bool]] = Counter()
    for _ in range(SETS):
        tasks = random_tasks(random)
        until = horizon(tasks)
        accepted = schedulable(tasks, policy)
        exact = not any(one.blocking for one in tasks)
        seen[accepted, exact] += 1
        if accepted:
            for jobs in (worst_jobs(tasks, until), random_jobs(tasks, until, random)):
                assert not run_jobs(jobs, policy, until).misses, tasks
        elif exact:
            assert run_jobs(worst_jobs(tasks, until), policy, until).misses, tasks
    assert min(seen.values()) > SETS / 20, seen
    assert len(seen) == 4


def test_response_times_are_those_of_the_worst_schedule():
    random, compared = Random(11), 0  # noqa: S311
    while compared < SETS / 10:
        tasks = random_tasks(random)
        if not schedulable(tasks, "fixed_priority"):
            continue
        for one in tasks:
            urgent = [other for other in tasks if other.priority > one.priority]
            until = horizon(tasks)
            schedule = run_jobs(worst_jobs([one, *urgent], until), "fixed_priority", until, blocked=one.blocking)
            assert schedule.responses()[one.name] == tests.response_time(one, urgent), (one, urgent)
        compared += 1


def test_the_utilisation_bound_never_accepts_what_the_response_times_refuse():
    random, accepted = Random(13), 0  # noqa: S311
    for _ in range(SETS):
        tasks = random_tasks(random)
        if tests.within_bound(tasks):
            accepted += 1
            assert schedulable(tasks, "fixed_priority"), tasks
    assert accepted > SETS / 200


def test_tasks_of_a_textbook():
    """The example of Tindell, Burns and Wellings (1994): a deadline beyond the period, several jobs in a busy period."""
    urgent, late = task("urgent", 70, 26, priority=2), task("late", 100, 62, 118, priority=1)
    assert tests.response_time(late, [urgent]) == 118
    assert tests.response_time(urgent, [late]) == 26
    assert tests.response_time(task("late", 100, 62, 117), [urgent]) == 118


def test_a_full_core_meets_its_deadlines_with_earliest_deadline_first_only():
    tasks = [task("a", 4, 2, priority=2), task("b", 6, 3, priority=1)]
    assert utilisation(tasks) == 1
    assert tests.overload(tasks) is None
    assert tests.response_time(tasks[1], tasks[:1]) == 7
    assert not tests.within_bound(tasks)


def test_an_overload_names_the_time_and_the_work():
    found = tests.overload([task("a", 10, 6, 7), task("b", 10, 3, 8)])
    assert found == tests.Demand(time=8, work=9)
    assert tests.overload([]) is None
    over = tests.overload([task("a", 10, 6), task("b", 10, 5)])
    assert over == tests.Demand(time=10, work=11)


def test_more_work_than_a_core_has_no_response_time():
    assert tests.response_time(task("a", 10, 6), [task("b", 10, 6)]) is None


def test_a_test_that_would_not_end_is_an_error():
    prime = task("a", 999_999_937, 999_999_936, 10**15)
    with pytest.raises(InputError, match="choose periods with a smaller common multiple"):
        tests.response_time(prime, [task("b", 10**18 - 1, 300_000, priority=1)])
