"""The end of `dsc lsp`, as the protocol asks for it: exit status 0 after `shutdown`."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pygls")


def frame(**message: Any) -> bytes:
    body = json.dumps({"jsonrpc": "2.0", **message}).encode()
    return b"Content-Length: %d\r\n\r\n" % len(body) + body


def test_the_exit_status():
    start = frame(id=1, method="initialize", params={"capabilities": {}, "processId": None, "rootUri": None})
    last = [frame(method="initialized", params={}), frame(id=2, method="shutdown"), frame(method="exit")]
    command: list[str | Path] = [Path(sys.executable).with_name("dsc"), "lsp"]
    done = subprocess.run(command, input=b"".join([start, *last]), capture_output=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
