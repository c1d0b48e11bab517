"""The page docs/speed.md, whose tables the benchmarks write."""

from pathlib import Path

PAGE = Path(__file__).parents[1] / "docs" / "speed.md"


def put(text: str, name: str) -> None:
    """Replace the text between `<!-- name -->` and `<!-- /name -->`."""
    begin, end = f"<!-- {name} -->\n", f"<!-- /{name} -->\n"
    head, _, rest = PAGE.read_text(encoding="utf-8").partition(begin)
    _, ended, tail = rest.partition(end)
    assert ended, f"{PAGE} has no place for {name}"
    PAGE.write_text(f"{head}{begin}{text}\n{end}{tail}", encoding="utf-8")
