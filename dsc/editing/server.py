"""The language server: answers of the other modules of this room in the Language Server Protocol 3.17, by `pygls`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcInvalidParams
from pygls.lsp.server import LanguageServer
from pygls.uris import from_fs_path, to_fs_path

from dsc.editing import navigation
from dsc.editing.checks import Checks
from dsc.editing.completion import Proposal, complete, word_before
from dsc.editing.diagnostics import Diagnostic
from dsc.editing.formatting import format_edits
from dsc.editing.goals import goal_at, goals_of
from dsc.editing.kinds import Kind
from dsc.editing.lines import Lines, Spot
from dsc.editing.name_index import LatestIndex
from dsc.editing.plans import Plans
from dsc.editing.projects import Examiner, Project
from dsc.editing.renaming import rename_at
from dsc.editing.surgery.text_edits import TextEdit
from dsc.editing.view import View
from dsc.editing.workspace import Workspace, text_of
from knowledge_base.errors import InputError

PLAN_COMMAND = "dsc.plan"
"""The command that plans the goal at a position: its arguments are a URI and a position."""
_SOURCE = "dsc"
_LEVELS = {"error": lsp.DiagnosticSeverity.Error, "warning": lsp.DiagnosticSeverity.Warning}

_ITEM_KINDS = {
    "key": lsp.CompletionItemKind.Property, "state": lsp.CompletionItemKind.EnumMember,
    "plot": lsp.CompletionItemKind.Module, "skill": lsp.CompletionItemKind.Function,
    "variable": lsp.CompletionItemKind.Variable, "event": lsp.CompletionItemKind.Event,
    "relation": lsp.CompletionItemKind.Function, "type": lsp.CompletionItemKind.Class,
}  # fmt: skip
_SYMBOL_KINDS = {
    "state": lsp.SymbolKind.Class, "variable": lsp.SymbolKind.Variable, "action": lsp.SymbolKind.Function,
    "relation": lsp.SymbolKind.Boolean, "type": lsp.SymbolKind.Struct,
}  # fmt: skip
_Asking = lsp.CompletionParams | lsp.HoverParams | lsp.DefinitionParams | lsp.ReferenceParams | lsp.RenameParams


class Server(LanguageServer):
    """The server of one editor.

    Args:
        find: returns the project around a file.
        examiner: examines projects in other processes.
        plans: plans goals in other processes.
        findings_page: the page with a section for each code of findings, to which diagnostics refer.
    """

    def __init__(
        self,
        find: Callable[[Path], Project | None],
        examiner: Examiner,
        plans: Plans,
        findings_page: Path | None = None,
    ) -> None:
        super().__init__("dsc", version("dynamic-state-charts"))
        self.checks = Checks(find, examiner.examine, self._publish, self._report)
        self.plans = plans
        self.findings_page = findings_page
        self._workspace = Workspace()
        self._latest = LatestIndex()
        add_text_features(self)
        add_answers(self)
        add_plan_view(self)

    def view(self, file: Path) -> View:
        """Return the page of a file, with the pages and facts of its project."""
        texts, project = self.checks.texts, self.checks.project(file)
        page = self._workspace.page(file, text_of(file, texts))
        root = file.parent if project is None else project.root
        pages = [page] if project is None else self._workspace.pages(root, texts)
        return View(page, tuple(pages), self.checks.facts(file), root, self._latest)

    async def plan_at(self, view: View, offset: int) -> dict[str, Any] | None:
        """Return the plan of the goal around an offset, see `Plans.plan`; `None` without a goal."""
        goal, file = goal_at(view.page, offset), view.page.file
        if goal is None:
            return None
        return await self.plans.plan(file, goal, self.checks.project(file), self.checks.texts)

    def _publish(self, file: Path, version: int | None, found: list[Diagnostic]) -> None:
        items = [_diagnostic(one, self._page(file)) for one in found]
        self.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri_of(file), items, version))

    def _page(self, file: Path) -> Path | None:
        """Return the page of findings in the project around a file, else the page of this package."""
        project = self.checks.project(file)
        own = None if project is None else project.root / "docs" / "findings.md"
        return own if own is not None and own.is_file() else self.findings_page

    def _report(self, line: str) -> None:
        self.window_log_message(lsp.LogMessageParams(lsp.MessageType.Warning, line))


def add_text_features(server: Server) -> None:
    """Let the server receive the texts of the editor."""

    @server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)
    def open_text(given: lsp.DidOpenTextDocumentParams) -> None:
        document = given.text_document
        server.checks.change(path_of(document.uri), document.text, document.version)

    @server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)
    def change_text(given: lsp.DidChangeTextDocumentParams) -> None:
        uri = given.text_document.uri
        text = server.workspace.get_text_document(uri).source
        server.checks.change(path_of(uri), text, given.text_document.version)

    @server.feature(lsp.TEXT_DOCUMENT_DID_SAVE)
    def save_text(given: lsp.DidSaveTextDocumentParams) -> None:
        server.checks.examine(path_of(given.text_document.uri))

    @server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)
    def close_text(given: lsp.DidCloseTextDocumentParams) -> None:
        server.checks.close(path_of(given.text_document.uri))

    @server.feature(lsp.SHUTDOWN)
    async def stop(_: None) -> None:
        await server.checks.stop()
        await server.plans.stop()

    @server.feature(lsp.TEXT_DOCUMENT_FORMATTING)
    def answer_formatting(given: lsp.DocumentFormattingParams) -> list[lsp.TextEdit]:
        page = server.view(path_of(given.text_document.uri)).page
        return _edits(format_edits(page.text) if page.kind is not Kind.PDDL else (), page.text)


def add_answers(server: Server) -> None:
    """Let the server answer questions about positions in the editor's texts."""

    def question(given: _Asking) -> tuple[View, int]:
        return _material(server, given.text_document.uri, given.position)

    @server.feature(lsp.TEXT_DOCUMENT_COMPLETION, lsp.CompletionOptions(trigger_characters=[" ", "(", "?", "{", "."]))
    def answer_completion(given: lsp.CompletionParams) -> lsp.CompletionList:
        view, offset = question(given)
        return lsp.CompletionList(is_incomplete=False, items=_items(complete(view, offset), view.page.text, offset))

    @server.feature(lsp.TEXT_DOCUMENT_HOVER)
    async def answer_hover(given: lsp.HoverParams) -> lsp.Hover | None:
        view, offset = question(given)
        plan = None if navigation.about_name(view, offset) else await server.plan_at(view, offset)
        text = navigation.hover(view, offset) if plan is None else f"**Plan**\n\n```text\n{plan['text']}\n```"
        return lsp.Hover(lsp.MarkupContent(lsp.MarkupKind.Markdown, text)) if text else None

    @server.feature(lsp.TEXT_DOCUMENT_DEFINITION)
    def answer_definition(given: lsp.DefinitionParams) -> list[lsp.Location]:
        return _locations(navigation.definitions(*question(given)), server.checks.texts)

    @server.feature(lsp.TEXT_DOCUMENT_REFERENCES)
    def answer_references(given: lsp.ReferenceParams) -> list[lsp.Location]:
        return _locations(navigation.references(*question(given)), server.checks.texts)

    @server.feature(lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
    def answer_symbols(given: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
        page = server.view(path_of(given.text_document.uri)).page
        return [_symbol(one, Lines(page.text)) for one in navigation.symbols(page)]

    @server.feature(lsp.TEXT_DOCUMENT_RENAME)
    def answer_rename(given: lsp.RenameParams) -> lsp.WorkspaceEdit:
        try:
            found = rename_at(*question(given), given.new_name)
        except InputError as error:
            raise JsonRpcInvalidParams(str(error)) from None
        for who, left in (("Python code", found.in_python), ("A text that may mean another thing", found.in_texts)):
            if places := ", ".join(f"{file}:{line}" for file, line in left):
                line = f"{who} also has this name, and is not changed: {places}"
                server.window_show_message(lsp.ShowMessageParams(lsp.MessageType.Warning, line))
        texts = server.checks.texts
        return lsp.WorkspaceEdit({uri_of(file): _edits(one, text_of(file, texts)) for file, one in found.edits.items()})

    @server.feature(lsp.TEXT_DOCUMENT_CODE_ACTION, lsp.CodeActionOptions([lsp.CodeActionKind.QuickFix]))
    def answer_fixes(given: lsp.CodeActionParams) -> list[lsp.CodeAction]:
        return [fix for one in given.context.diagnostics for fix in _fixes(given.text_document.uri, one)]


def add_plan_view(server: Server) -> None:
    """Let the server plan goals: the command `dsc.plan`, and a code lens above each goal that executes the command."""

    @server.feature(lsp.TEXT_DOCUMENT_CODE_LENS)
    def answer_lenses(given: lsp.CodeLensParams) -> list[lsp.CodeLens]:
        uri = given.text_document.uri
        page = server.view(path_of(uri)).page
        spots = [_position(Lines(page.text).spot(goal.begin)) for goal in goals_of(page)]
        return [lsp.CodeLens(lsp.Range(at, at), lsp.Command("Plan", PLAN_COMMAND, arguments=[uri, at])) for at in spots]

    @server.command(PLAN_COMMAND)
    async def answer_plan(uri: str, position: lsp.Position) -> dict[str, Any]:
        view, offset = _material(server, uri, position)
        plan = await server.plan_at(view, offset)
        if plan is None:
            raise JsonRpcInvalidParams(f"there is no goal in line {position.line + 1} of {view.page.file}")
        server.window_show_message(lsp.ShowMessageParams(lsp.MessageType.Info, plan["text"]))
        return plan


def _material(server: Server, uri: str, position: lsp.Position) -> tuple[View, int]:
    """Return the material of an answer, and the offset of a position."""
    view = server.view(path_of(uri))
    return view, Lines(view.page.text).offset(Spot(position.line, position.character))


def _fixes(uri: str, found: lsp.Diagnostic) -> Iterator[lsp.CodeAction]:
    """Yield the quick fix that writes the nearest valid name, if the diagnostic has one."""
    data = found.data if isinstance(found.data, dict) else {}
    meant = data.get("nearest")
    if found.source == _SOURCE and meant:
        edit = lsp.WorkspaceEdit(changes={uri: [lsp.TextEdit(found.range, str(meant))]})
        title, kind = f"Write '{meant}'", lsp.CodeActionKind.QuickFix
        yield lsp.CodeAction(title, kind, [found], is_preferred=True, edit=edit)


def _items(proposals: Iterable[Proposal], text: str, offset: int) -> list[lsp.CompletionItem]:
    """Return completion items that replace the word before the cursor."""
    begin = offset - len(word_before(text, offset))
    lines = Lines(text)
    around = lsp.Range(_position(lines.spot(begin)), _position(lines.spot(offset)))
    return [
        lsp.CompletionItem(
            one.label,
            kind=_ITEM_KINDS.get(one.kind, lsp.CompletionItemKind.Value),
            detail=one.kind,
            documentation=one.about or None,
            text_edit=lsp.TextEdit(around, one.label),
        )
        for one in proposals
    ]


def _locations(ranges: Iterable[navigation.Range], texts: Mapping[Path, str]) -> list[lsp.Location]:
    found = []
    for one in ranges:
        if one.line is None:
            lines = Lines(text_of(one.file, texts))
            begin, end = _position(lines.spot(one.begin)), _position(lines.spot(one.end))
        else:
            begin = end = lsp.Position(one.line, 0)
        found.append(lsp.Location(uri_of(one.file), lsp.Range(begin, end)))
    return found


def _edits(edits: Iterable[TextEdit], text: str) -> list[lsp.TextEdit]:
    lines = Lines(text)
    return [
        lsp.TextEdit(lsp.Range(_position(lines.spot(one.begin)), _position(lines.spot(one.end))), one.text)
        for one in edits
    ]


def _symbol(one: navigation.Symbol, lines: Lines) -> lsp.DocumentSymbol:
    begin, end, first, last = (_position(lines.spot(at)) for at in (one.begin, one.end, one.name_begin, one.name_end))
    return lsp.DocumentSymbol(
        one.name,
        _SYMBOL_KINDS.get(one.kind, lsp.SymbolKind.Object),
        lsp.Range(begin, end),
        lsp.Range(first, last),
        detail=one.kind,
        children=[_symbol(each, lines) for each in one.inside],
    )


def path_of(uri: str) -> Path:
    """Return the file of a URI."""
    return Path(to_fs_path(uri) or uri)


def uri_of(file: Path) -> str:
    """Return the URI of a file."""
    return from_fs_path(str(file)) or file.as_uri()


def _position(spot: Spot) -> lsp.Position:
    return lsp.Position(spot.line, spot.column)


def _diagnostic(found: Diagnostic, page: Path | None) -> lsp.Diagnostic:
    link = None if page is None else lsp.CodeDescription(f"{uri_of(page)}#{found.code}")
    return lsp.Diagnostic(
        range=lsp.Range(_position(found.start), _position(found.end)),
        message=found.text,
        severity=_LEVELS[found.level],
        code=found.code,
        code_description=link,
        source=_SOURCE,
        data={"found": found.found, "nearest": found.nearest},
    )
