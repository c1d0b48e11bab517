// Starts `dsc lsp` for plots, profiles, scenarios and PDDL.
const { workspace } = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

function activate() {
  const folder = workspace.workspaceFolders?.[0]?.uri.fsPath ?? "";
  const command = workspace.getConfiguration("dsc").get("command").replace("${workspaceFolder}", folder);
  const server = { command, args: ["lsp"] };
  const documentSelector = [
    { scheme: "file", language: "pddl" },
    { scheme: "file", language: "yaml", pattern: "**/{plots,profiles,scenarios}/*.{yaml,yml}" },
  ];
  client = new LanguageClient("dsc", "Dynamic State Charts", server, { documentSelector });
  return client.start();
}

function deactivate() {
  return client?.stop();
}

module.exports = { activate, deactivate };
