"""The language server: answers of the other modules of this room in the Language Server Protocol 3.17, by `pygls`."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

from lsprotocol import types as lsp
from pygls.lsp.server import LanguageServer
from pygls.uris import from_fs_path, to_fs_path

from dsc.editing.checks import Checks
from dsc.editing.diagnostics import Diagnostic
from dsc.editing.lines import Spot
from dsc.editing.projects import Examiner, Project

_SOURCE = "dsc"
_LEVELS = {"error": lsp.DiagnosticSeverity.Error, "warning": lsp.DiagnosticSeverity.Warning}


class Server(LanguageServer):
    """The server of one editor.

    Args:
        find: returns the project around a file.
        examiner: examines projects in other processes.
        findings_page: the page with a section for each code of findings, to which diagnostics refer.
    """

    def __init__(
        self, find: Callable[[Path], Project | None], examiner: Examiner, findings_page: Path | None = None
    ) -> None:
        super().__init__("dsc", version("dynamic-state-charts"))
        self.checks = Checks(find, examiner.examine, self._publish, self._report)
        self.findings_page = findings_page
        add_text_features(self)

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
