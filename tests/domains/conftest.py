"""One planner process for all runs of a test session: starting it costs a second."""

import asyncio

import pytest

from planning import PlannerProcess


@pytest.fixture(scope="session")
def planner():
    process = PlannerProcess()
    yield process
    asyncio.run(process.close())
