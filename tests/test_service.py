"""The example of a web service: two robots, an approval, a queue, SIGTERM in the middle of a request, and a restart."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import httpx
import pytest

EXAMPLES = Path(__file__).parent.parent / "examples"
PATIENCE_S = 60


class Servers(ThreadingHTTPServer):
    """The service behind the skills: acts once for each key; the first request fails, and `install/blue1` is slow."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.acted: dict[str, str] = {}
        self.requests: Counter[str] = Counter()
        self.slow = threading.Event()
        self.clients: list[subprocess.Popen[bytes]] = []
        threading.Thread(target=self.serve_forever, daemon=True).start()


class Handler(BaseHTTPRequestHandler):
    server: Servers

    def do_POST(self) -> None:
        key, path = self.headers["Idempotency-Key"], self.path.strip("/")
        self.server.requests[path] += 1
        failed = sum(self.server.requests.values()) == 1
        if not failed:
            self.server.acted.setdefault(key, path)
        if path == "install/blue1" and not self.server.slow.is_set():
            self.server.slow.set()
            time.sleep(1.0)  # the client is gone when the answer comes
        self.send_response(503 if failed else 200)
        self.send_header("content-length", "0")
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        pass


class Service:
    """The example in a process of its own."""

    def __init__(self, folder: Path, servers: Servers, app: str = "service:app") -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        address = f"http://127.0.0.1:{servers.server_port}/"
        environment = {**os.environ, "STORES": str(folder), "SERVERS": address, "PYTHONPATH": str(EXAMPLES)}
        command = [sys.executable, "-m", "uvicorn", "--app-dir", str(folder), "--port", str(self.port), app]
        self.process = subprocess.Popen([*command, "--log-level", "warning"], env=environment, stderr=subprocess.PIPE)
        servers.clients.append(self.process)
        self.client = httpx.Client(base_url=f"http://127.0.0.1:{self.port}", timeout=PATIENCE_S)
        until(self.is_there)

    def is_there(self) -> bool:
        assert self.process.poll() is None, self.process.stderr.read() if self.process.stderr else ""
        try:
            return self.client.get("/blue/goals").status_code == 200
        except httpx.TransportError:
            return False

    def states(self, robot: str) -> list[str]:
        return [one["state"] for one in self.client.get(f"/{robot}/goals").json()["goals"]]

    def stop(self) -> bytes:
        self.client.close()
        self.process.send_signal(signal.SIGTERM)
        _, errors = self.process.communicate(timeout=PATIENCE_S)
        return errors


def until(condition) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.fixture
def servers():
    served = Servers()
    yield served
    for process in served.clients:
        process.kill()  # of a test that has failed
        process.wait()
    served.shutdown()
    served.server_close()


def test_the_service_reaches_its_goals_over_a_restart_with_one_effect_for_each_request(tmp_path, servers):
    service = Service(tmp_path, servers)
    refused = service.client.post("/blue/goals", json={"goal": "(updatd blue1)"})
    assert (refused.status_code, "did you mean 'updated'" in refused.json()["error"]) == (400, True)
    for robot in ("blue", "green"):
        first = service.client.post(f"/{robot}/goals", json={"goal": f"(drained {robot}2)"}).json()["put"]
        change = {"goal": f"(updated {robot}1)", "replaces": first}
        assert service.client.post(f"/{robot}/goals", json=change).status_code == 200
    with service.client.stream("GET", "/blue/events") as stream:
        service.client.post("/blue/approve/blue1")
        seen = (json.loads(line.removeprefix("data: "))["type"] for line in stream.iter_lines() if line)
        assert next(kind for kind in seen if kind == "action") == "action"
    until(servers.slow.is_set)
    service.stop()
    (tmp_path / "newer.py").write_text(
        "import service\nfrom dsc import parse_plot\n"
        "UNUSED = parse_plot('{plot: unused, states: {over: {final: true}}}')\n"
        "APPROVAL, made = service.APPROVAL, service.Robot\n"
        "service.Robot = lambda domain, plots, *parts, **how: made(domain, [UNUSED, *plots], *parts, **how)\n"
        "app = service.app\n"
    )
    service = Service(tmp_path, servers, "newer:app")
    until(lambda: service.states("blue") == ["reached"])
    assert service.states("green") == ["running"]  # nobody has approved
    service.client.post("/green/approve/green1")
    until(lambda: service.states("green") == ["reached"])
    assert service.stop() == b""
    effects = sorted(servers.acted.values())
    assert effects == ["drain/blue1", "drain/green1", "install/blue1", "install/green1"]
    assert servers.requests["install/blue1"] == 2
