"""The gateway as an application: what it answers to, and in which order."""

import json
from dataclasses import replace
from functools import cache, partial

from fastapi import Depends, FastAPI, Request, Response
from fastapi.middleware.cors import CORSMiddleware
from starlette.responses import HTMLResponse
from starlette.routing import Route

import dynhull_client
from dynhull_client import AsyncHullClient

from . import alarms, feed_consumers, fences, handlers, health, hulls, people, points, questions, tracks, uploads
from .bodies import JSON, LimitedBodies
from .description import description_of
from .ends import AnsweredAtTheEnd
from .events import replays, subscriptions
from .events import routes as events
from .events.documents import EVENTS
from .events.shared import SharedWatches
from .figures import Figures, Measured
from .gathering import Gatherer
from .heads import HeadAsGet
from .hosts import KnownHosts
from .known_names import KnownNames
from .ogc import routes as maps
from .ogc.entities import Snapshots
from .page import Dashboard
from .page.routes import routes_of
from .parameters import require_known, require_once
from .paths import PathsAsSent
from .problems import RESPONSES
from .read_only import ReadOnly
from .settings import Settings
from .short_way import ShortWay
from .waits import WaitsForCallers

DESCRIPTION = """Exact convex hulls of points that are inserted, moved and deleted.

Every error is an `application/problem+json` (RFC 9457) that names the field, the position and the value at fault. A
token of the server is sent as `Authorization: Bearer`. Numbers are doubles; there is null where a double is infinite or
not a number. A slash in the name of a hull, a fence or an alarm is written `%2F` in a path.
Of a name that is given twice in an object of JSON, the last one counts.

The examples work as they are written, each after those that create what it names: hulls first, then points, fences,
alarms, questions."""
SEEN_BY_PAGES = ["Idempotency-Key", "Last-Event-ID", "Authorization", "Content-Type"]


def application(client: AsyncHullClient, settings: Settings) -> FastAPI:
    """The application, in front of a server. The caller closes the client."""
    app = FastAPI(
        title="dynhull gateway",
        version=dynhull_client.__version__,
        description=DESCRIPTION,
        license_info={"name": "Apache 2.0", "identifier": "Apache-2.0"},
        openapi_url=None,  # below, with a newline at its end
        docs_url=None,  # the framework's pages load scripts from elsewhere
        redoc_url=None,
        telemetry={"tracing": False, "metrics": False, "logs": False},  # it looks for these with each request
        responses=RESPONSES,
        dependencies=[Depends(require_known), Depends(require_once)],
        separate_input_output_schemas=False,
        generate_unique_id_function=lambda route: route.name,
    )
    app.state.client = client
    app.state.settings = settings
    app.state.gatherer = Gatherer()
    app.state.shared = SharedWatches()
    app.state.joined = {}
    app.state.snapshots = Snapshots()
    app.state.health = health.State()
    app.state.figures = Figures()
    of_past = tracks, feed_consumers
    of_events = events, replays, subscriptions
    modules = hulls, points, uploads, fences, alarms, questions, *of_past, *of_events, maps, health
    routers = [module.router for module in modules]
    page = cache(lambda: Dashboard(replace(settings.page, address=client.address), settings.root_path))
    app.router.routes[:0] = pages = routes_of(page, first=settings.read_only)
    for router in routers:
        app.include_router(router)
    app.openapi = partial(description_of, app, EVENTS)  # type: ignore[method-assign]  # the framework's way to have one's own
    described = [
        Route("/openapi.json", _answer_description, include_in_schema=False),
        Route("/docs", _answer_people, include_in_schema=False),
    ]
    app.router.routes.extend(described)
    app.state.routes = [*pages, *described, *(route for router in routers for route in router.routes)]
    handlers.install(app)
    app.add_middleware(WaitsForCallers, routes=app.state.routes, root_path=settings.root_path)
    app.add_middleware(ShortWay, root_path=settings.root_path)
    app.add_middleware(LimitedBodies, settings=settings)
    if settings.origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=settings.origins,
            allow_methods=["GET", "POST", "PUT", "DELETE"],
            allow_headers=SEEN_BY_PAGES,
            expose_headers=["Location", "Link", "Retry-After"],
        )
    if settings.read_only:
        app.add_middleware(ReadOnly, root_path=settings.root_path)
    if settings.hosts:
        app.add_middleware(KnownHosts, hosts=settings.hosts)
    if settings.names:
        app.add_middleware(KnownNames, names=settings.names)
    app.add_middleware(Measured, figures=app.state.figures)
    app.add_middleware(HeadAsGet)
    app.add_middleware(PathsAsSent, root_path=settings.root_path)
    app.add_middleware(AnsweredAtTheEnd, health=app.state.health)
    return app


async def _answer_description(request: Request) -> Response:
    servers = {"servers": [{"url": request.scope.get("root_path") or "/"}]}
    return Response(f"{json.dumps(request.app.openapi() | servers)}\n", media_type=JSON)


async def _answer_people(request: Request) -> Response:
    page = people.page_of(request.app.openapi(), request.scope.get("root_path", ""))
    return HTMLResponse(page, headers={"Content-Security-Policy": people.POLICY})
