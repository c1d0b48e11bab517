"""Pages of the site that mkdocs generates: the README, the reference, and the files that pages link to.

Links in the sources are relative to the checkout, so that they work on a code host. Each link to a file outside `docs`
leads, in the site, to a page with the content of that file.
"""

from __future__ import annotations

import ast
import json
import posixpath
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from dsc.text.plot_files import json_schema

ROOT = Path(__file__).parents[1]
PACKAGES = ("dsc", "dsc.testing", "dsc.wire", "planning", "knowledge_base")
FIXED = {"README.md": "index.md"}
PROJECT = ("dsc/viewer/PROTOCOL.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md")
"""Files of the checkout with an entry in the navigation."""
_LINK = re.compile(r"(\]\()([^)\s#]+)((?:#[^)\s]*)?\))")
_REMOTE = re.compile(r"""(?:src=|<link [^>]*rel=["']?stylesheet["']? [^>]*href=)["']?(https?:[^"' >]+)""")
_SEARCH_SCRIPT = re.compile(r"https:[^\"' >]+/iframe-worker/[^\"' >]+")
_FENCE = re.compile(r"(^```.*?^```[^\n]*$)", re.MULTILINE | re.DOTALL)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the generated pages."""
    pages = {"reference/command.md": _command(), "reference/plot-schema.md": _schema()}
    pages |= {f"reference/{package}.md": _package(package) for package in PACKAGES}
    origins = {"README.md": (ROOT / "README.md").read_text()}
    origins |= {f"docs/{file.src_uri}": file.content_string for file in files.documentation_pages()}
    waiting = [*PROJECT, *(target for origin, text in origins.items() for target in _outside(origin, text))]
    pages["index.md"] = _moved(origins["README.md"], "README.md", "index.md")
    while waiting:
        path = waiting.pop()
        if _site(path) not in pages:
            text = _content(path)
            pages[_site(path)] = _moved(text, path, _site(path))
            waiting += _outside(path, text)
    for uri, text in pages.items():
        files.append(File.generated(config, uri, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Leads links of a page in `docs` to the pages of the site."""
    uri = page.file.src_uri
    return markdown if page.file.generated_by else _moved(markdown, f"docs/{uri}", uri)


def on_post_page(output: str, page: Page, **_: Any) -> str:
    """Serves the theme's search script from the site, so that a page loads nothing from the network."""
    return _local(output, page.file.dest_uri)


def on_post_template(output_content: str, template_name: str, **_: Any) -> str:
    """Does the same for the page about a missing page."""
    return _local(output_content, template_name)


def _local(output: str, uri: str) -> str:
    script = posixpath.relpath("assets/iframe-worker.js", posixpath.dirname(uri) or ".")
    output = _SEARCH_SCRIPT.sub(script, output)
    if remote := _REMOTE.search(output):
        message = f"{uri}: the page loads {remote[1]} from the network"
        raise PluginError(message)
    return output


def _targets(origin: str, text: str) -> Iterator[str]:
    for part in _FENCE.split(text)[::2]:
        for match in _LINK.finditer(part):
            if "://" not in match[2] and not match[2].startswith("mailto:"):
                yield _resolved(origin, match[2])


def _outside(origin: str, text: str) -> list[str]:
    return [path for path in _targets(origin, text) if not path.startswith("docs/") and path not in FIXED]


def _resolved(origin: str, link: str) -> str:
    path = posixpath.normpath(posixpath.join(posixpath.dirname(origin), link))
    if path.startswith("..") or not (ROOT / path).exists():
        message = f"{origin}: the link '{link}' leads to no file of the checkout"
        raise PluginError(message)
    return path


def _site(path: str) -> str:
    """The page of the site for a file of the checkout."""
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    return FIXED.get(path, f"source/{path}" if path.endswith(".md") else f"source/{path}.md")


def _moved(text: str, origin: str, uri: str) -> str:
    """The text with its links relative to its place in the site."""

    def lead(match: re.Match[str]) -> str:
        if "://" in match[2] or match[2].startswith("mailto:"):
            return match[0]
        target = _site(_resolved(origin, match[2]))
        return match[1] + posixpath.relpath(target, posixpath.dirname(uri) or ".") + match[3]

    parts = _FENCE.split(text)
    return "".join(part if index % 2 else _LINK.sub(lead, part) for index, part in enumerate(parts))


def _content(path: str) -> str:
    """A file or folder of the checkout as Markdown."""
    file = ROOT / path
    if file.is_dir():
        names = sorted(one.name for one in file.iterdir() if one.suffix in {".py", ".md", ".pddl", ".yaml"})
        return f"# {path}\n\n" + "".join(f"- [{name}]({file.name}/{name})\n" for name in names)
    text = file.read_text()
    if file.suffix == ".md":
        return text
    language = {".py": "python", ".pddl": "lisp"}.get(file.suffix, file.suffix[1:])
    return f"# {path}\n\n````{language}\n{text}````\n"


def _package(package: str) -> str:
    """The public names of a package, as its stub lists them."""
    stub = ast.parse((ROOT / package.replace(".", "/") / "__init__.pyi").read_text())
    names = sorted(
        (alias.asname or alias.name, f"{node.module}.{alias.name}")
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    )
    return f"# Package {package}\n\n" + "\n".join(f"::: {path}\n" for _, path in names)


def _command() -> str:
    """The commands and their options, from the Typer app."""
    words = [sys.executable, "-m", "typer", "planning.cli.command", "utils", "docs", "--name", "dsc"]
    text = subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True).stdout  # noqa: S603
    return text.replace("# `dsc`", "# Command `dsc`", 1)


def _schema() -> str:
    """The JSON Schema of plots as tables, then as JSON."""
    schema = json_schema()
    lines = ["# Schema of plots", "", "`dsc plot schema` prints this JSON Schema for editors.", ""]
    for name, part in {"Plot": schema, **schema["$defs"]}.items():
        if "properties" in part:
            lines += [f"## {name}", "", *_keys(part), ""]
    return "\n".join([*lines, "## JSON", "", "```json", json.dumps(schema, indent=2), "```", ""])


def _keys(part: dict[str, Any]) -> Iterator[str]:
    """The table of an object's keys, with the description of each."""
    about, _, attributes = part.get("description", "").partition("Attributes:")
    described = dict(re.findall(r"^ *(\w+): (.+(?:\n {5,}.+)*)", attributes, re.MULTILINE))
    yield from (about.strip(), "", "| key | type | required | description |", "| --- | --- | --- | --- |")
    for key, one in part["properties"].items():
        needed = "yes" if key in part.get("required", []) else ""
        text = " ".join(described.get("name" if key == "plot" else key, "").split()).replace("|", "\\|")
        yield f"| `{key}` | {_type(one)} | {needed} | {text} |"


def _type(part: Any) -> str:
    """A type of the schema in words."""
    if not isinstance(part, dict):
        return "any"
    kinds = part.get("anyOf") or part.get("oneOf")
    if kinds:
        return " or ".join(dict.fromkeys(map(_type, kinds)))
    if "const" in part or "enum" in part:
        return ", ".join(f"`{one}`" for one in part.get("enum", [part.get("const")]))
    match part.get("type"):
        case "array":
            return f"list of {_type(part.get('items'))}"
        case "object" if isinstance(part.get("additionalProperties"), dict):
            return f"map to {_type(part['additionalProperties'])}"
    return f"`{part['$ref'].rpartition('/')[2]}`" if "$ref" in part else str(part.get("type", "any"))
