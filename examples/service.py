"""A web service with two robots: queued goals, an approval, HTTP skills that a restart repeats safely, events.

`uvicorn --app-dir examples service:app` serves it. STORES is the folder of the robots' stores, and SERVERS the address
that the skills call. SIGTERM suspends the runs, and the next start resumes them.
"""

import asyncio
import json
import os
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import asdict
from pathlib import Path
from typing import NewType

import httpx
from starlette.applications import Starlette
from starlette.responses import JSONResponse, StreamingResponse
from starlette.routing import Route

from dsc import Component, Outcome, SkillCall, parse_plot, primitive_plot, skill
from knowledge_base import Delta, InputError, fact
from planning import PlanningDomain, Robot

DOMAIN = PlanningDomain.parse("""
(define (domain rollout) (:types server)
  (:predicates (approved ?s - server) (drained ?s - server) (updated ?s - server))
  (:action approve :parameters (?s - server) :effect (approved ?s))
  (:action drain :parameters (?s - server) :precondition (approved ?s) :effect (drained ?s))
  (:action install :parameters (?s - server) :precondition (drained ?s) :effect (updated ?s)))
""")
APPROVAL = parse_plot("""
plot: approval
implements: approve
parameters: {s: server}
states: {wait: {always: {to: over, when: (approved ?s)}}, over: {final: true}}
""")  # an operator approves in the knowledge base
Server = NewType("Server", str)


class Changed(Outcome): ...


class Pool(Component):
    name = "pool"
    device_errors = (httpx.HTTPError,)

    @skill(after_crash="repeat")
    async def drain(self, call: SkillCall, s: Server) -> Changed:
        await self.request(call, f"drain/{s}")
        return Changed(observed=Delta(added=(fact("drained", s),)))

    @skill(after_crash="repeat")
    async def install(self, call: SkillCall, s: Server) -> Changed:
        await self.request(call, f"install/{s}")
        return Changed(observed=Delta(added=(fact("updated", s),)))

    async def request(self, call: SkillCall, path: str) -> None:
        async with httpx.AsyncClient(base_url=os.environ["SERVERS"]) as client:
            for pause in (0.05, 0.2, 0.8, None):
                answer = await client.post(path, headers={"Idempotency-Key": call.key})
                if answer.status_code < 500 or pause is None:
                    break
                await call.clock.sleep(pause)
            answer.raise_for_status()


def robot(name: str) -> Robot:
    pool = Pool()
    plots = [primitive_plot(one, done="changed", implements=action) for action, one in pool.skills().items()]
    made = Robot(DOMAIN, [APPROVAL, *plots], [pool], store=Path(os.environ["STORES"]) / f"{name}.kb")
    made.knowledge.apply(Delta(nodes={f"{name}1": "server", f"{name}2": "server"}), author="inventory")
    return made


@asynccontextmanager
async def lifespan(app):
    async with AsyncExitStack() as stack:
        app.state.robots = {name: await stack.enter_async_context(robot(name)) for name in ("blue", "green")}
        for one in app.state.robots.values():
            stack.callback(asyncio.create_task(one.serve()).cancel)
        yield


async def goals(request):
    queue = request.app.state.robots[request.path_params["robot"]].goals
    try:
        number = queue.put(**await request.json()) if request.method == "POST" else None
    except InputError as error:
        return JSONResponse({"error": str(error)}, 400)
    return JSONResponse({"put": number, "goals": [asdict(one) for one in queue.list("waiting", "running", "reached")]})


async def approve(request):
    one = request.app.state.robots[request.path_params["robot"]]
    one.knowledge.apply(Delta(added=(fact("approved", request.path_params["server"]),)), author="operator")
    return JSONResponse({})


async def events(request):
    records = asyncio.Queue()
    request.app.state.robots[request.path_params["robot"]].listen(records.put_nowait)

    async def lines():
        while True:
            record = await records.get()
            yield f"data: {json.dumps({'type': record.type, 'time': record.t})}\n\n"

    return StreamingResponse(lines(), media_type="text/event-stream")


app = Starlette(lifespan=lifespan, routes=[
    Route("/{robot}/goals", goals, methods=["GET", "POST"]),
    Route("/{robot}/approve/{server}", approve, methods=["POST"]),
    Route("/{robot}/events", events),
])  # fmt: skip
