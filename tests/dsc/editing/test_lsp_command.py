"""The command without its extra."""

from __future__ import annotations

import subprocess
import sys

WITHOUT = (
    "import sys; sys.modules['pygls'] = None; sys.argv = ['dsc', 'lsp']; from planning.cli.command import main; main()"
)


def test_the_command_without_pygls_names_the_extra():
    done = subprocess.run([sys.executable, "-c", WITHOUT], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert "pip install 'dynamic-state-charts[edit]'" in done.stderr


def test_the_server_is_not_imported_by_other_commands():
    code = "import sys; import planning.cli.command; print('pygls' in sys.modules, 'dsc.editing.checks' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]
