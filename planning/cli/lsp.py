"""Command `dsc lsp`: a language server for plots, profiles, scenarios and PDDL (S1.16)."""

from __future__ import annotations

import sys
from pathlib import Path


def lsp_command() -> None:
    """Serve an editor over standard input and output, by the Language Server Protocol.

    Editors start this command themselves; see docs/editor.md. It needs the extra `edit`.
    """
    from knowledge_base.errors import InputError

    try:
        from dsc.editing.server import Server
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in {"pygls", "lsprotocol"}:
            raise
        message = "dsc lsp needs pygls: pip install 'dynamic-state-charts[edit]'"
        raise InputError(message, found=error.name) from None
    from dsc.editing.plans import Plans
    from dsc.editing.projects import Examiner
    from planning.robot.project_search import project_around

    page = Path(__file__).parents[2] / "docs" / "findings.md"
    examiner = Examiner([sys.executable, "-m", "planning.cli.examination"])
    plans = Plans([sys.executable, "-m", "planning.cli.goal_planning"])
    Server(project_around, examiner, plans, page if page.is_file() else None).start_io()
