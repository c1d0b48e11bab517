"""A headless editor: a client of `dsc lsp` over standard input and output."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from lsprotocol import types as lsp
from pygls.lsp.client import LanguageClient

DSC = Path(sys.executable).with_name("dsc")
LIMIT_S = 60.0


class Editor(LanguageClient):
    """An editor with open texts and the diagnostics that it has received."""

    def __init__(self) -> None:
        super().__init__("headless", "1")
        self.told: list[lsp.PublishDiagnosticsParams] = []
        self.shown: list[str] = []
        self.news = asyncio.Event()
        self.versions: dict[str, int] = {}

        @self.feature(lsp.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        def receive(given: lsp.PublishDiagnosticsParams) -> None:
            self.told.append(given)
            self.news.set()

        @self.feature(lsp.WINDOW_SHOW_MESSAGE)
        def show(given: lsp.ShowMessageParams) -> None:
            self.shown.append(given.message)
            self.news.set()

        @self.feature(lsp.WINDOW_LOG_MESSAGE)
        def log(given: lsp.LogMessageParams) -> None:
            self.shown.append(given.message)

    async def begin(self, root: Path) -> lsp.InitializeResult:
        await self.start_io(str(DSC), "lsp")
        result = await self.initialize_async(
            lsp.InitializeParams(capabilities=lsp.ClientCapabilities(), root_uri=root.as_uri())
        )
        self.initialized(lsp.InitializedParams())
        return result

    def open(self, file: Path, text: str | None = None) -> str:
        text = file.read_text("utf-8") if text is None else text
        language = "pddl" if file.suffix == ".pddl" else "yaml"
        self.versions[file.as_uri()] = 1
        self.text_document_did_open(
            lsp.DidOpenTextDocumentParams(lsp.TextDocumentItem(file.as_uri(), language, 1, text))
        )
        return text

    def change(self, file: Path, text: str) -> int:
        uri = file.as_uri()
        self.versions[uri] += 1
        self.text_document_did_change(
            lsp.DidChangeTextDocumentParams(
                lsp.VersionedTextDocumentIdentifier(self.versions[uri], uri),
                [lsp.TextDocumentContentChangeWholeDocument(text)],
            )
        )
        return self.versions[uri]

    async def until(self, holds: Callable[[], bool]) -> None:
        async with asyncio.timeout(LIMIT_S):
            while not holds():
                self.news.clear()
                await self.news.wait()

    def latest(self, file: Path) -> list[lsp.Diagnostic] | None:
        """Return the present diagnostics of a file; `None` before the first ones."""
        own = [one for one in self.told if one.uri == file.as_uri()]
        return [*own[-1].diagnostics] if own else None

    def messages(self, file: Path) -> str:
        return "\n".join(one.message for one in self.latest(file) or ())

    async def end(self) -> None:
        await self.shutdown_async(None)
        self.exit(None)
        await self.stop()


def edited(work: Callable[[Editor], Awaitable[Any]], root: Path) -> Any:
    """Return the result of some work with an editor, whose server ends afterwards."""

    async def session() -> Any:
        editor = Editor()
        await editor.begin(root)
        try:
            return await work(editor)
        finally:
            await editor.end()

    return asyncio.run(session())


def at(text: str, part: str, inside: int = 0, nth: int = 0) -> lsp.Position:
    """Return the position of a part of a text, `inside` characters after its begin."""
    offset = -1
    for _ in range(nth + 1):
        offset = text.index(part, offset + 1)
    before = text[: offset + inside]
    line = before.count("\n")
    last = before.rpartition("\n")[2]
    return lsp.Position(line, len(last.encode("utf-16-le")) // 2)
