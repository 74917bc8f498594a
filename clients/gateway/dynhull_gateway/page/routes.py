"""Where the page and its files are."""

from collections.abc import Callable
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from ..problems import ProblemError
from . import PATH, Dashboard

FOREVER = "public, max-age=31536000, immutable"  # their path has their version


def routes_of(dashboard: Callable[[], Dashboard], *, first: bool) -> list[Route]:
    """The routes.

    Args:
        dashboard: the page, made when somebody asks for it.
        first: whether the page is what the gateway answers with at its own address, too.
    """
    files = f"{PATH}/{{version}}/{{file:path}}"

    async def answer_page(_: Request) -> Response:
        page = dashboard()
        headers = {"Content-Security-Policy": page.policy, "Cache-Control": "no-cache"}
        return Response(page.html, media_type="text/html", headers=headers)

    async def answer_version(_: Request) -> Response:
        return PlainTextResponse(dashboard().version, headers={"Cache-Control": "no-store"})

    async def answer_metrics(_: Request) -> Response:
        metrics = dashboard().settings.metrics
        if metrics is None:
            raise ProblemError(404, "start the dashboard with --metrics", "NOT_FOUND")
        return JSONResponse(await metrics.read(), headers={"Cache-Control": "no-store"})

    async def answer_file(request: Request) -> Response:
        page = dashboard()
        found = page.files.get(request.path_params["file"])
        if found is None or request.path_params["version"] != page.version:
            raise ProblemError(404, f"no such file: the page at {page.root}{PATH} says where they are", "NOT_FOUND")
        headers = {"Cache-Control": FOREVER, "Vary": "Accept-Encoding", "X-Content-Type-Options": "nosniff"}
        if "gzip" in request.headers.get("accept-encoding", ""):
            return Response(
                found.compressed, media_type=found.media_type, headers={**headers, "Content-Encoding": "gzip"}
            )
        return Response(found.content, media_type=found.media_type, headers=headers)

    answers: dict[str, Any] = {
        PATH: answer_page,
        f"{PATH}/version": answer_version,
        f"{PATH}/metrics": answer_metrics,
        files: answer_file,
    }
    if first:
        answers["/"] = answer_page
    return [Route(path, answer, include_in_schema=False) for path, answer in answers.items()]
