"""The answer of a process to an editor: unsaved texts on standard input, one JSON value on standard output."""

from __future__ import annotations

import json
import logging
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from knowledge_base.pddl.unsaved_texts import unsaved_texts


def answer_editor(work: Callable[[], Any]) -> None:
    """Write the result of some work as JSON; the files have the texts of standard input, a JSON object by file."""
    answers = os.dup(1)
    os.dup2(2, 1)  # the project's code may print
    logging.disable()  # each programming error is part of the answer
    texts = {Path(file): text for file, text in json.load(sys.stdin).items()}
    with unsaved_texts(texts):
        answer = json.dumps(work())
    with os.fdopen(answers, "w", encoding="utf-8") as out:
        out.write(answer)
