"""The recipes for editors: Neovim as the page configures it, and the manifest of the VS Code extension."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
VSCODE = ROOT / "editors" / "vscode"
NVIM = shutil.which("nvim")
DRIVE = """
vim.wait(60000, function() return #vim.diagnostic.get(0) > 0 end, 50)
local found = vim.diagnostic.get(0)
local params = { textDocument = vim.lsp.util.make_text_document_params(), position = { line = %d, character = %d } }
local answers = vim.lsp.buf_request_sync(0, "textDocument/completion", params, 30000)
local labels = {}
for _, answer in pairs(answers) do
  for _, item in ipairs(answer.result.items) do table.insert(labels, item.label) end
end
vim.fn.writefile({ vim.fn.json_encode({ found = found[1].message, line = found[1].lnum, labels = labels }) }, "%s")
vim.cmd("qa!")
"""


@pytest.mark.skipif(NVIM is None, reason="Neovim is not installed")
def test_neovim_shows_diagnostics_and_completion_by_the_recipe_of_the_page(project, tmp_path):
    recipe = re.search(r"```lua\n(.*?)```", (ROOT / "docs" / "editor.md").read_text(), re.DOTALL)
    assert recipe is not None
    file, answer = project / "porter" / "plots" / "drive.yaml", tmp_path / "answer.json"
    file.write_text(file.read_text().replace("arrived: there", "arrived: their"))
    lines = file.read_text().splitlines()
    number = next(at for at, line in enumerate(lines) if "arrived" in line)
    (tmp_path / "init.lua").write_text(recipe[1])
    (tmp_path / "drive.lua").write_text(DRIVE % (number, lines[number].index("their"), answer))
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "HOME": str(tmp_path)}
    command = [str(NVIM), "--headless", "-u", str(tmp_path / "init.lua"), "-i", "NONE", str(file)]
    subprocess.run(
        [*command, "-c", f"luafile {tmp_path / 'drive.lua'}"], cwd=project, env=environment, timeout=120, check=True,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip
    said = json.loads(answer.read_text())
    assert said["line"] == number
    assert "'their'; did you mean 'there'?" in said["found"]
    assert {"there", "stuck", "go"} <= set(said["labels"])


def test_the_manifest_of_the_extension_names_files_and_settings_that_exist():
    manifest = json.loads((VSCODE / "package.json").read_text())
    code = (VSCODE / manifest["main"]).read_text()
    languages = manifest["contributes"]["languages"]
    assert all((VSCODE / one["configuration"]).is_file() for one in languages)
    settings = manifest["contributes"]["configuration"]["properties"]
    assert {f"dsc.{name}" for name in re.findall(r'getConfiguration\("dsc"\)\.get\("(\w+)"\)', code)} == set(settings)
    required = {name.partition("/")[0] for name in re.findall(r'require\("([\w/-]+)"\)', code)} - {"vscode"}
    assert required == set(manifest["dependencies"])
    assert {one["id"] for one in languages} <= set(re.findall(r'language: "(\w+)"', code))
