"""A headless client gets completion, hover, definitions, references, symbols, fixes and renames of a project."""

from __future__ import annotations

from editor_client import Editor, at, edited
from lsprotocol import types as lsp


def asking(file, position):
    return {"text_document": lsp.TextDocumentIdentifier(file.as_uri()), "position": position}


async def ready(editor: Editor, file, text=None):
    text = editor.open(file, text)
    await editor.until(lambda: any("known-skill" in str(one.code) for one in editor.latest(file) or ()))
    return text


def test_each_ability_on_the_project_of_the_tutorial(project):
    plot, domain = project / "porter" / "plots" / "drive.yaml", project / "porter" / "domain.pddl"
    saved = plot.read_text()
    text = saved.replace("plot: drive", "about: drive 🚪 on\nplot: drive").replace("base.drive", "base.drve")

    async def labels(editor: Editor, position: lsp.Position, file=plot) -> set[str]:
        found = await editor.text_document_completion_async(lsp.CompletionParams(**asking(file, position)))
        return {one.label for one in found.items}

    async def work(editor: Editor) -> None:
        await ready(editor, plot, text)
        (wrong,) = [one for one in editor.latest(plot) or () if one.code == "known-skill"]
        fixes = await editor.text_document_code_action_async(
            lsp.CodeActionParams(lsp.TextDocumentIdentifier(plot.as_uri()), wrong.range, lsp.CodeActionContext([wrong]))
        )
        assert [one.title for one in fixes or ()] == ["Write 'base.drive'"]
        good = text.replace("base.drve", "base.drive")
        editor.change(plot, good)
        assert {"base.drive", "gripper.pick_up"} <= await labels(editor, at(good, "base.drive", 2))
        assert {"there", "stuck", "go"} <= await labels(editor, at(good, "arrived: there", 9))
        assert {"arrived", "door_closed", "done"} <= await labels(editor, at(good, "arrived: there"))
        assert {"?from", "?to"} <= await labels(editor, at(good, "start: ?from", 8))
        assert {"start", "to"} <= await labels(editor, at(good, "start: ?from"))
        assert {"entry", "on", "use", "goal"} <= await labels(editor, at(good, "entry:", 2))
        hover = await editor.text_document_hover_async(lsp.HoverParams(**asking(plot, at(good, "base.drive", 3))))
        assert "base.drive(start: room, to: room)" in hover.contents.value
        hover = await editor.text_document_hover_async(lsp.HoverParams(**asking(plot, at(good, "entry:", 2))))
        assert "external actions on entry" in hover.contents.value
        skills = await editor.text_document_definition_async(
            lsp.DefinitionParams(**asking(plot, at(good, "base.drive", 3)))
        )
        assert isinstance(skills, list)
        (skill,) = skills
        assert skill.uri.endswith("skills.py")
        line = (project / "porter" / "skills.py").read_text().splitlines()[skill.range.start.line :][:3]
        assert "async def drive" in "\n".join(line)
        states = await editor.text_document_definition_async(
            lsp.DefinitionParams(**asking(plot, at(good, ": there", 3)))
        )
        assert isinstance(states, list)
        (state,) = states
        assert state.range.start == at(good, "  there:", 2)
        symbols = await editor.text_document_document_symbol_async(
            lsp.DocumentSymbolParams(lsp.TextDocumentIdentifier(plot.as_uri()))
        )
        assert [one.name for one in symbols or ()] == ["from", "to", "go", "there", "stuck"]
        edit = await editor.text_document_rename_async(
            lsp.RenameParams(lsp.TextDocumentIdentifier(plot.as_uri()), at(good, "  there:", 3), "arrived_there")
        )
        assert {uri: len(edits) for uri, edits in edit.changes.items()} == {plot.as_uri(): 2}
        options = lsp.FormattingOptions(tab_size=2, insert_spaces=True)
        formatting = lsp.DocumentFormattingParams(lsp.TextDocumentIdentifier(plot.as_uri()), options)
        assert not await editor.text_document_formatting_async(formatting)
        text_of_domain = editor.open(domain)
        found = await editor.text_document_references_async(
            lsp.ReferenceParams(
                context=lsp.ReferenceContext(include_declaration=True),
                **asking(domain, at(text_of_domain, "carries", 2)),
            )
        )
        assert len(found or ()) == 4
        edit = await editor.text_document_rename_async(
            lsp.RenameParams(lsp.TextDocumentIdentifier(domain.as_uri()), at(text_of_domain, "lies-in", 2), "rests-in")
        )
        assert {uri.rpartition("/")[2]: len(edits) for uri, edits in edit.changes.items()} == {
            "domain.pddl": 4,
            "deliver_all.yaml": 1,
        }
        await editor.until(lambda: any("Python code also has this name" in one for one in editor.shown))
        assert {"robot-in", "carries", "and"} <= await labels(editor, at(text_of_domain, "(robot-in ?from)", 1), domain)

    edited(work, project)
