"""Comments that ignore findings: `# dsc: ignore[known-object] the camera finds it`, with `;` in PDDL."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from dsc.codes import CODES
from dsc.errors import Finding
from knowledge_base.errors import InputError, Place, UnknownNameError
from knowledge_base.pddl.unsaved_texts import readable_text

_COMMENT = re.compile(r"^(?P<code>.*?)[#;]\s*dsc:\s*ignore\[(?P<codes>[^\]]*)\](?P<reason>.*)$")
_EXAMPLE = "`# dsc: ignore[known-object] the camera finds it`"


@dataclass(frozen=True, slots=True)
class Ignore:
    """A comment that ignores the findings of its line, or of the next line if the comment is alone in its line.

    Attributes:
        place: the comment.
        line: the line whose findings it ignores.
        codes: the codes of these findings.
        reason: the text after the codes.
    """

    place: Place
    line: int
    codes: tuple[str, ...]
    reason: str

    def covers(self, finding: Finding) -> bool:
        """Return whether the comment ignores the finding."""
        place = finding.place
        same = place is not None and (place.source, place.line) == (self.place.source, self.line)
        return same and finding.code in self.codes

    def mistakes(self) -> Iterator[Finding]:
        """Yield the findings about the comment itself."""
        for code in self.codes:
            if code not in CODES:
                error = UnknownNameError(f"there is no code '{code}'", place=self.place, found=code, valid=CODES)
                yield Finding(error, "ignore")
        if not self.codes or not self.reason:
            missing = "reason" if self.codes else "code"
            yield Finding(InputError(f"the comment has no {missing}", place=self.place), "ignore", f"as in {_EXAMPLE}")


def without_ignored(findings: Iterable[Finding], files: Iterable[Path]) -> list[Finding]:
    """Return the findings that no comment ignores, with those about the comments of the files.

    A comment with a mistake ignores nothing. A comment that ignores no finding is a warning.

    Args:
        findings: the findings about the files.
        files: the checked files.
    """
    left = list(findings)
    sources = {str(file): file for file in files}
    sources |= {one.place.source: Path(one.place.source) for one in left if one.place and one.place.source}
    for source, file in sources.items():
        for comment in _comments(file, source):
            mistakes = list(comment.mistakes())
            ignored = [] if mistakes else [one for one in left if comment.covers(one)]
            left = [one for one in left if one not in ignored] + mistakes
            if not ignored and not mistakes:
                error = InputError("the comment ignores no finding", place=comment.place)
                left.append(Finding(error, "ignore", "remove it", "warning"))
    return left


def _comments(file: Path, source: str) -> Iterator[Ignore]:
    for number, line in enumerate(readable_text(file).splitlines(), 1):  # another finding reports an unreadable file
        found = _COMMENT.match(line) if "dsc:" in line else None
        if found is not None:
            codes = tuple(code.strip() for code in found["codes"].split(",") if code.strip())
            about = number if found["code"].strip() else number + 1
            yield Ignore(Place(source, number), about, codes, found["reason"].strip())
