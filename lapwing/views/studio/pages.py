"""Pages of the studio and their routes."""

import shlex
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import Mount, Route

from lapwing.cosim.scene import SceneError
from lapwing.services.common.schemas.run_schema import Run, title
from lapwing.views import report
from lapwing.views.report.flight_header import MANY, differences
from lapwing.views.studio.form_fields import PLACED, additions, form
from lapwing.views.studio.recent_flights import RecentFlights
from lapwing.views.studio.run_processes import StudioRuns
from lapwing.views.studio.scene_forms import (
    OFF,
    SPEEDS,
    SWITCHED,
    command_line,
    form_changes,
    load_named,
    merged,
    paths_and_warnings,
    posted_form,
    python,
    scene_files,
    schema,
    tables,
    toml_text,
)
from lapwing.views.view3d import MISSING as NO_VIEW
from lapwing.views.view3d import available

HERE = Path(__file__).parent
STATIC = {"studio.js": "text/javascript", "map.js": "text/javascript", "studio.css": "text/css"}
MOST_COMPARED = 4  # largest number of flights in a comparison
REPORT_POLICY = (  # a report runs its scripts in a sandbox with a separate origin and no network
    "sandbox allow-scripts allow-downloads; default-src data: blob: 'unsafe-inline' 'unsafe-eval'; "
    "frame-ancestors 'self'; form-action 'none'; base-uri 'none'"
)
_TEMPLATES = Environment(
    loader=FileSystemLoader([HERE / "templates", Path(report.__file__).parent]),
    autoescape=True,
    trim_blocks=True,
    lstrip_blocks=True,
    undefined=StrictUndefined,
)


class Pages:
    """Pages of the studio; each public method handles a route."""

    def __init__(self, token: str, runs: StudioRuns, flights: RecentFlights):
        """Create the pages below the secret path."""
        self._base, self._runs, self._flights = f"/{token}", runs, flights
        get, post = ["GET"], ["POST"]
        routes = [
            Route("/", self.home, methods=get),
            Route("/static/{name}", self.static, methods=get),
            Route("/scenes/{name}", self.scene, methods=get),
            Route("/scenes/{name}/preview", self.preview, methods=post),
            Route("/scenes/{name}/run", self.start, methods=post),
            Route("/runs/{number:int}", self.run, methods=get),
            Route("/runs/{number:int}/state", self.state, methods=get),
            Route("/runs/{number:int}/stop", self.stop, methods=post),
            Route("/flights/{name}", self.flight, methods=get),
            Route("/flights/{name}/card", self.card, methods=get),
            Route("/flights/{name}/report", self.report, methods=get),
            Route("/compare", self.compare, methods=get),
            Route("/compare/report", self.compare_report, methods=get),
        ]
        handlers: Mapping[Any, Callable[..., Any]] = {HTTPException: self._fault, KeyError: self._not_found}
        self.application = Starlette(routes=[Mount(self._base, routes=routes)], exception_handlers=handlers)

    def _page(self, template: str, status: int = 200, **values: Any) -> HTMLResponse:
        text = _TEMPLATES.get_template(template).render(base=self._base, current=self._runs.current, **values)
        return HTMLResponse(text, status)

    def _fault(self, _: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        return self._page("fault.html", error.status_code, message=error.detail)

    def _not_found(self, _: Request, error: Exception) -> Response:
        return self._page("fault.html", 404, message=f"{error.args[0]}: no such scene, run or flight")

    def static(self, request: Request) -> Response:
        """Return a script or style sheet of this package."""
        name = request.path_params["name"]
        if name not in STATIC:
            raise HTTPException(404)
        text = _TEMPLATES.get_template(name).render() if name.endswith(".css") else (HERE / name).read_text("utf-8")
        return Response(text, media_type=STATIC[name])

    def home(self, request: Request) -> Response:
        """List scenes and recent flights, or those that match the query `q`."""
        query = request.query_params.get("q", "")
        words = query.lower().split()
        scenes = []
        for name, path in scene_files().items():
            try:
                about, broken = title(path), False
            except SceneError as error:
                about, broken = str(error), True
            if all(word in f"{name} {about}".lower() for word in words):
                scenes.append((name, about, broken))
        return self._page("home.html", query=query, scenes=scenes, flights=self._flights.search(query))

    def card(self, request: Request) -> Response:
        """Return the HTML fragment of a flight."""
        return self._page("card.html", flight=self._flights.summary(request.path_params["name"]))

    def scene(self, request: Request) -> Response:
        """Show the form of a scene, with the changes and added tables of the query."""
        name = request.path_params["name"]
        sets, added = request.query_params.getlist("set"), request.query_params.getlist("add")
        return self._form(name, sets, added)

    def _form(
        self,
        name: str,
        sets: Iterable[str] = (),
        added: Iterable[str] = (),
        posted: Mapping[str, str] | None = None,
        faults: Mapping[str, str] | None = None,
        error: str = "",
        status: int = 200,
    ) -> Response:
        added = tuple(dict.fromkeys(added))
        try:
            base = load_named(name, tables(added))
        except SceneError as fault:
            if added:  # the form stays, without the table that does not fit
                return self._form(name, sets, added[:-1], posted, faults, f"{added[-1]}: {fault.sentence}", 422)
            return self._page("fault.html", 422, message=str(fault))
        texts = dict(posted or {})
        fields = {field.key: field for group in form(base, schema()) for field in group.all_fields()}
        for text in sets:
            key, _, value = text.partition("=")
            if value == OFF and key.count(".") == 1 and key.startswith(SWITCHED):
                texts[key] = value
            elif key in fields:
                texts[key] = value[1:-1] if fields[key].kind != "toml" and value[:1] == '"' else value
            else:
                error = error or f"{text}: cannot be changed in this form; use lapwing run {name} --set"
        return self._page(
            "scene.html",
            status,
            name=name,
            about=title(scene_files()[name]),
            groups=form(base, schema()),
            additions=additions(base, schema()),
            added=added,
            placed=PLACED,
            switched=SWITCHED,
            texts=texts,
            faults=dict(faults or {}),
            error=error,
            speeds=SPEEDS,
            speed=texts.get("speed", "1"),
            view=texts.get("view", "yes") == "yes",
            no_view="" if available() else NO_VIEW,
        )

    async def preview(self, request: Request) -> Response:
        """Return the command line, the Python code and the faults of a posted form as JSON."""
        name, posted, added = await posted_form(request)
        changed, faults, error = await run_in_threadpool(form_changes, name, posted, added)
        sound = not (faults or error)
        found = await run_in_threadpool(lambda: paths_and_warnings(load_named(name, changed))) if sound else None
        paths, warnings = found or ([], [])
        command = command_line(name, changed, posted.get("speed", ""), posted.get("view") == "yes")
        texts = {"command": shlex.join(command), "python": python(name, changed), "toml": toml_text(name, changed)}
        keys = [change.key for change in changed]
        seen = {"changed": keys, "faults": faults, "paths": paths, "warnings": warnings}
        return JSONResponse({**texts, **seen, "error": error})

    async def start(self, request: Request) -> Response:
        """Start a run of a posted form and show it; show the form again if it has faults."""
        name, posted, added = await posted_form(request)
        changed, faults, error = await run_in_threadpool(form_changes, name, posted, added)
        speed, view = posted.get("speed", ""), posted.get("view") == "yes" and available()
        if speed not in SPEEDS:
            error = error or f"speed {speed}: expected one of {', '.join(SPEEDS)}"
        if not (faults or error):
            try:
                run = self._runs.start(name, changed, speed, view)
                return RedirectResponse(f"{self._base}/runs/{run.number}", 303)
            except ValueError as fault:
                error = str(fault)
        return await run_in_threadpool(self._form, name, (), added, {"view": "no", **posted}, faults, error, 422)

    def run(self, request: Request) -> Response:
        """Show a run: live while it is running, then its result."""
        run = self._runs.all[request.path_params["number"]]
        log = run.log if not run.running else None
        names = self._flights.names()
        summary = self._flights.summary(log.name) if log and log.name in names else None
        others = [name for name in names if summary is None or name != summary.name]
        query = [("add", c.key) if isinstance(c.value, dict) else ("set", c.override) for c in run.changed]
        return self._page(
            "run.html",
            run=run,
            changed=merged(run.changed),
            flight=summary,
            previous=others[0] if others else "",
            change_query=urlencode(query),
            command=shlex.join(run.command),
            python=python(run.scene, run.changed),
            duration=load_named(run.scene, run.changed)[Run].duration if run.running else 0.0,
        )

    def state(self, request: Request) -> Response:
        """Return the state of a run as JSON."""
        return JSONResponse(self._runs.all[request.path_params["number"]].state())

    def stop(self, request: Request) -> Response:
        """Interrupt a run."""
        number = request.path_params["number"]
        self._runs.all[number].stop()
        return RedirectResponse(f"{self._base}/runs/{number}", 303)

    def flight(self, request: Request) -> Response:
        """Show a recorded flight."""
        name = request.path_params["name"]
        path = self._flights.path(name)
        code = f"import lapwing\n\nflight = lapwing.read_log({str(path)!r})\nprint(flight.outcome)\n"
        flight = self._flights.summary(name)
        scene = next((each for each in scene_files() if each.removesuffix(".toml") == flight.scene), "")
        command = _report_command(path)
        return self._page("flight_page.html", flight=flight, scene=scene, command=command, python=code)

    def report(self, request: Request) -> Response:
        """Return the report of a flight."""
        return self._report(request.path_params["name"])

    def compare(self, request: Request) -> Response:
        """Show flights side by side."""
        names = list(dict.fromkeys(request.query_params.getlist("flight")))
        if not 2 <= len(names) <= MOST_COMPARED:
            raise HTTPException(422, f"{len(names)} flights are selected; select 2 to {MOST_COMPARED} to compare")
        flights = [self._flights.summary(name) for name in names]
        paths = [self._flights.path(name) for name in names]
        labels = list(dict.fromkeys(number.label for flight in flights for number in flight.numbers))
        rows = [(label, [next((n for n in f.numbers if n.label == label), None) for f in flights]) for label in labels]
        return self._page(
            "compare.html",
            flights=flights,
            rows=rows,
            differing=differences(flights[0].tree, flights[1].tree) if len(names) == 2 else {},
            many=MANY,
            pair=urlencode([("flight", name) for name in names[:2]]) if len(names) == 2 else "",
            command=_report_command(*paths) if len(names) == 2 else "",
        )

    def compare_report(self, request: Request) -> Response:
        """Return the report of an overlay of two flights."""
        names = request.query_params.getlist("flight")
        if len(names) != 2:
            raise HTTPException(422, f"{len(names)} flights; expected two")
        return self._report(*names)

    def _report(self, *names: str) -> Response:
        try:
            path = self._flights.report(*names)
        except ValueError as error:
            raise HTTPException(422, str(error)) from None
        return FileResponse(path, media_type="text/html", headers={"Content-Security-Policy": REPORT_POLICY})


def _report_command(*paths: Path) -> str:
    return shlex.join(["lapwing", "report", *map(str, paths)])
