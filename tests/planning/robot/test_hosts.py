"""Programs around a robot: a notebook's kernel, pytest-asyncio, uvloop, and a thread that is not the main one."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import threading
from pathlib import Path

import lamp_robot
import nbformat
import pytest
import uvloop
from lamp_robot import robot
from nbclient import NotebookClient

from dsc import run_real, run_simulated

ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(lamp_robot.__file__).parent)}


async def every_way(store) -> list[bool]:
    """Start, achieve, queue, suspend and resume in the running loop."""
    async with robot() as one:
        reached = [(await one.start("(lit)")).reached, (await one.start("turn_on")).reached]
        reached.append((await one.achieving("(lit)")).reached)
        one.goals.put("(lit)")
        await one.serve(until_empty=True)
        reached.append(bool(one.goals.list("reached")))
    async with robot(store=store) as one:
        one.start("(lit)").suspend()
    async with robot(store=store) as one:
        reached.append((await one.resume_or_start("(lit)")).reached)
    return reached


def in_another_thread(work):
    """Return the result of `work` in a new thread."""
    results = []
    thread = threading.Thread(target=lambda: results.append(work()))
    thread.start()
    thread.join(60)
    return results[0]


def test_every_way_in_uvloop(tmp_path):
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        assert all(runner.run(every_way(tmp_path / "run.kb")))


@pytest.mark.parametrize("run", [asyncio.run, run_real, run_simulated])
def test_every_way_in_a_thread_that_is_not_the_main_one(run, tmp_path):
    assert all(in_another_thread(lambda: run(every_way(tmp_path / "run.kb"))))


@pytest.mark.parametrize("clock", ["real", "simulated"])
def test_the_methods_without_a_loop_in_a_thread_that_is_not_the_main_one(clock, tmp_path):
    def methods():
        with robot(clock=clock, store=tmp_path / "run.kb") as one:
            return one.run("turn_on").reached and one.achieve("(lit)").reached

    assert in_another_thread(methods)


CELLS = [
    "from lamp_robot import robot",
    'one = robot()\nend = await one.achieving("(lit)")\nend',
    'run = one.start("turn_on")\nrecords = [record.type async for record in run.records()]\nprint(records[-1])',
    'run = one.start("(lit)")\n(await run).reached',
    "one.knowledge",
    'one.achieve("(lit)")',
    'print(await one.achieving("(lit)"))',
]


def test_every_way_in_the_kernel_of_a_notebook(tmp_path):
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in CELLS])
    client = NotebookClient(notebook, timeout=60, allow_errors=True, resources={"metadata": {"path": str(tmp_path)}})
    client.execute(env=ENVIRONMENT)
    outputs = [cell.outputs for cell in notebook.cells]
    assert "reached" in outputs[1][0].data["text/html"]
    assert outputs[2][0].text == "end\n"
    assert outputs[3][0].data["text/plain"] == "True"
    assert "image/svg+xml" in outputs[4][0].data
    assert outputs[5][0].evalue.endswith("`await robot.achieving(...)`")
    assert outputs[6][0].text.startswith("RunEnd(finished=True")  # after the refused call the notebook goes on


ASYNC_TESTS = """
import pytest
from lamp_robot import robot

@pytest.fixture
async def one():
    async with robot() as made:
        yield made

async def test_a_goal(one):
    assert await one.achieving("(lit)")

async def test_a_run(one):
    run = one.start("turn_on")
    assert (await run).reached and run.state.over

async def test_the_coroutine_is_named(one):
    with pytest.raises(Exception, match="await robot.achieving"):
        one.achieve("(lit)")

def test_without_a_loop():
    with robot(clock="simulated") as made:
        assert made.achieve("(lit)")
"""


def test_every_way_in_pytest_asyncio(tmp_path):
    (tmp_path / "test_lamp.py").write_text(ASYNC_TESTS)
    (tmp_path / "pytest.ini").write_text(
        "[pytest]\nasyncio_mode = auto\nasyncio_default_fixture_loop_scope = function\nfilterwarnings = error\n"
    )
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path)]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=100, cwd=tmp_path, env=ENVIRONMENT, check=False
    )
    assert "4 passed" in done.stdout, done.stdout
