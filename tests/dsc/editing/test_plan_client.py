"""A headless client gets plans of goals: by hover, by the command `dsc.plan`, and by code lenses."""

from __future__ import annotations

import asyncio

import pytest
from editor_client import Editor, at, edited
from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException

PROBLEM = """\
(define (problem one)   ; (:goal (carries book)) is a comment
  (:domain delivery)
  (:objects lab store - room book - parcel)
  (:init (robot-in lab) (lies-in book store) (empty))
  (:goal (carries book)))
"""


async def hover(editor: Editor, file, position: lsp.Position) -> str:
    given = lsp.HoverParams(lsp.TextDocumentIdentifier(file.as_uri()), position)
    found = await editor.text_document_hover_async(given)
    return "" if found is None else found.contents.value


async def run(editor: Editor, file, position: lsp.Position):
    given = lsp.ExecuteCommandParams("dsc.plan", [file.as_uri(), position])
    return await editor.workspace_execute_command_async(given)


def test_the_plan_of_a_state_in_the_initial_world(project):
    file, domain = project / "porter" / "plots" / "deliver_all.yaml", project / "porter" / "domain.pddl"

    async def work(editor: Editor) -> None:
        text = editor.open(file)
        given = lsp.CodeLensParams(lsp.TextDocumentIdentifier(file.as_uri()))
        (lens,) = await editor.text_document_code_lens_async(given) or ()
        assert lens.range.start == at(text, "goal:")
        assert lens.command is not None
        assert lens.command.command == "dsc.plan"
        plan = await run(editor, file, at(text, "goal:"))
        assert plan["steps"][:2] == ["(drive kitchen hall)", "(pick-up book hall)"]
        assert len(plan["steps"]) == plan["text"].count("\n")
        assert plan["text"] in editor.shown
        assert plan["text"] in await hover(editor, file, at(text, "goal:", 2))
        assert plan["text"] in await hover(editor, file, at(text, "forall"))
        assert "lies-in" in await hover(editor, file, at(text, "lies-in", 2))
        with pytest.raises(JsonRpcException, match=r"no goal in line 1 of .*deliver_all\.yaml"):
            await run(editor, file, lsp.Position(0, 0))
        saved = editor.open(domain)
        editor.change(domain, saved.replace(":effect (and (not (carries ?parcel)) (empty) (lies-in ?parcel ?room))",
                                            ":effect (and (not (carries ?parcel)) (empty))"))  # fmt: skip
        none = await run(editor, file, at(text, "goal:"))
        assert (none["outcome"], none["steps"]) == ("unsolvable", [])
        assert "there is no plan" in none["text"]
        assert "lies-in" in none["text"]

    edited(work, project)


def test_a_goal_with_a_variable_names_it_and_a_wrong_goal_its_mistake(project):
    file = project / "porter" / "plots" / "deliver_all.yaml"

    async def work(editor: Editor) -> None:
        text = editor.open(file, "plot: bring\nparameters: {item: parcel}\nstates:\n  go: {goal: (carries ?item)}\n")
        assert "a value of ?item, which only a run gives" in await hover(editor, file, at(text, "goal:"))
        text = text.replace("?item)", "itm)")
        editor.change(file, text)
        assert "'itm'" in await hover(editor, file, at(text, "goal:"))

    edited(work, project)


def test_the_plan_of_a_problem_in_its_own_initial_state(project):
    file = project / "porter" / "one.pddl"

    async def work(editor: Editor) -> None:
        editor.open(file, PROBLEM)
        plan = await run(editor, file, at(PROBLEM, "(:goal", 3, nth=1))
        assert plan["steps"] == ["(drive lab store)", "(pick-up book store)"]
        assert plan["text"] in await hover(editor, file, at(PROBLEM, ":goal", 2, nth=1))
        assert await hover(editor, file, at(PROBLEM, "(:goal", 3)) == ""

    edited(work, project)


def test_a_goal_outside_of_a_project_has_no_initial_world(tmp_path):
    file = tmp_path / "wait.yaml"

    async def work(editor: Editor) -> None:
        text = editor.open(file, "plot: wait\nstates:\n  go: {goal: (quiet)}\n")
        assert "no robot is found around this file" in await hover(editor, file, at(text, "goal:"))

    edited(work, tmp_path)


def test_other_answers_while_a_plan_is_made(project):
    file, flag, code = (
        project / "porter" / "plots" / "deliver_all.yaml",
        project / "go",
        project / "porter" / "robot.py",
    )
    wait = f"import pathlib, time\nwhile not pathlib.Path({str(flag)!r}).exists():\n    time.sleep(0.01)\n"
    head, mark, rest = code.read_text().partition("from __future__ import annotations\n")
    code.write_text(head + mark + wait + rest)

    async def work(editor: Editor) -> None:
        text = editor.open(file)
        plan = asyncio.ensure_future(hover(editor, file, at(text, "goal:")))
        assert "state `delivered`" in await hover(editor, file, at(text, "done: delivered", 8))
        assert not plan.done()
        flag.touch()
        assert "(drive kitchen hall)" in await plan

    edited(work, project)
