"""A headless client receives the findings of a project about unsaved texts."""

from __future__ import annotations

from editor_client import Editor, at, edited
from lsprotocol import types as lsp


def test_a_client_sees_findings_of_its_buffer_with_range_code_and_link(project):
    file = project / "porter" / "plots" / "drive.yaml"
    text = file.read_text()
    wrong = text.replace("plot: drive", "about: to a room 🚪\nplot: drive").replace("base.drive", "base.drve")
    wrong = wrong.replace("{trigger", "{ trigger")

    async def work(editor: Editor) -> None:
        editor.open(file, text)
        await editor.until(lambda: editor.latest(file) is not None)
        editor.change(file, wrong)
        await editor.until(lambda: "base.drve" in editor.messages(file))
        (found,) = [one for one in editor.latest(file) or () if one.code == "known-skill"]
        assert found.range == lsp.Range(at(wrong, "base.drve"), at(wrong, "base.drve", 9))
        assert found.severity == lsp.DiagnosticSeverity.Error
        assert found.code_description is not None
        assert found.code_description.href.endswith("findings.md#known-skill")
        assert "did you mean 'base.drive'?" in found.message
        editor.change(file, text)
        await editor.until(lambda: editor.latest(file) == [])

    edited(work, project)
    assert file.read_text() == text


def test_a_half_written_file_never_silences_the_others(project):
    plots = project / "porter" / "plots"
    half, other = plots / "drive.yaml", plots / "pick_up.yaml"
    domain = project / "porter" / "domain.pddl"

    async def work(editor: Editor) -> None:
        editor.open(half, half.read_text() + "  broken: {entry: [\n")
        editor.open(other, other.read_text().replace("picked_up: held", "picked_up: helt"))
        editor.open(domain, domain.read_text().replace("(robot-in ?from)) (robot-in", "(robot-in ?from)) (robot-inn"))
        texts = (half, "not readable"), (other, "'helt'"), (domain, "robot-inn")
        await editor.until(lambda: all(said in editor.messages(file) for file, said in texts))
        editor.change(half, half.read_text())
        await editor.until(lambda: "not readable" not in editor.messages(half))
        await editor.until(lambda: all(said in editor.messages(file) for file, said in texts[1:]))

    edited(work, project)


def test_a_change_in_one_file_is_a_finding_in_another_file_that_is_not_open(project):
    domain = project / "porter" / "domain.pddl"
    plot = project / "porter" / "plots" / "pick_up.yaml"

    async def work(editor: Editor) -> None:
        text = editor.open(domain)
        editor.change(domain, text.replace("(:action pick-up", "(:action take-up"))
        await editor.until(lambda: "no planning action 'pick-up'" in editor.messages(plot))
        editor.change(domain, text)
        await editor.until(lambda: editor.latest(plot) == [])

    edited(work, project)


def test_a_file_without_a_project_is_checked_alone(tmp_path):
    file = tmp_path / "alone.yaml"

    async def work(editor: Editor) -> None:
        editor.open(file, "plot: alone\nstates:\n  go: {on: {over: ende}}\n  end: {final: true}\n")
        await editor.until(lambda: "'ende'" in editor.messages(file))

    edited(work, tmp_path)
