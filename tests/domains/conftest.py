"""One planner process for all runs of a test session: starting it costs a second."""

import asyncio
import sys
from pathlib import Path

import pytest

from planning import PlannerProcess

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the soak is a command and a test


@pytest.fixture(scope="session")
def planner():
    process = PlannerProcess()
    yield process
    asyncio.run(process.close())
