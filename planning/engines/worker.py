"""The planner process: `python -m planning.engines.worker`.

It speaks one JSON object a line. First it says `{"ready": true}`; then each line on standard input is a
problem (`Problem.to_json`) and each line on standard output its answer: `{"actions": [3, 0, ...]}`,
`{"actions": null}` when there is proven to be no plan, or `{"failed": "why"}`. It ends when its standard
input does, even in the middle of a search: a planner never outlives who asked.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
from typing import IO, Any


def main() -> None:
    """Serve until standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one who asked
    answers = _claim_stdout()
    requests: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(requests,), daemon=True).start()
    _say(answers, _import_engine())
    while True:
        _say(answers, _answer(requests.get()))


def _claim_stdout() -> IO[str]:
    """Our answers' way out; whatever libraries print goes to standard error instead."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    return answers


def _read(requests: queue.SimpleQueue[str]) -> None:
    for line in sys.stdin:
        requests.put(line)
    os._exit(0)  # from this thread nothing gentler ends a search


def _say(answers: IO[str], answer: dict[str, Any]) -> None:
    answers.write(json.dumps(answer) + "\n")
    answers.flush()


def _import_engine() -> dict[str, Any]:
    """Import ahead of the first problem; a failure is told again, as the answer to each problem."""
    try:
        import planning.engines.up  # noqa: F401, PLC0415  warmed here so that no problem pays for it
    except Exception as error:  # noqa: BLE001  a broken installation is an answer, too
        return {"ready": True, "failed": _described(error)}
    return {"ready": True}


def _answer(line: str) -> dict[str, Any]:
    try:
        from planning.engines.up import solve  # noqa: PLC0415  see _import_engine
        from planning.strips import Problem  # noqa: PLC0415

        return {"actions": solve(Problem.from_json(json.loads(line)))}
    except Exception as error:  # noqa: BLE001  an engine may raise anything; the process must go on
        return {"failed": _described(error)}


def _described(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"


if __name__ == "__main__":
    main()
