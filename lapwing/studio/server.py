"""Server of the studio at a secret address on this machine."""

import asyncio
import secrets
import socket
import threading
import webbrowser
from collections.abc import Callable

from lapwing.studies.local_pages import ADDRESS, hosts
from lapwing.studio import require
from lapwing.studio.recent_flights import RecentFlights
from lapwing.studio.run_processes import StudioRuns


def serve(port: int, report: Callable[[str], None]) -> None:
    """Serve the page until SIGINT or SIGTERM, which also end the current run.

    Args:
        port: TCP port; 0: any free one.
        report: called with the line with the address.

    Raises:
        ValueError: the extra `studio` is missing, or the port is in use.
    """
    require()
    import uvicorn

    from lapwing.studio.guard import Guard
    from lapwing.studio.pages import Pages
    from lapwing.studio.scene_forms import schema

    token = secrets.token_urlsafe(16)
    with _listening(port) as listener, StudioRuns() as runs:
        number = listener.getsockname()[1]
        flights = RecentFlights(runs.folder)
        pages = Pages(token, runs, flights)
        guarded = Guard(pages.application, token, hosts(number))
        options = {"log_level": "critical", "lifespan": "off", "server_header": False, "ws": "none"}
        server = uvicorn.Server(uvicorn.Config(guarded, **options))  # type: ignore[arg-type]
        address = f"http://{ADDRESS}:{number}/{token}/"
        report(f"studio: {address}")
        for prepare in (schema, flights.read_all):  # to show the first form and all cards without delay
            threading.Thread(target=prepare, daemon=True).start()
        webbrowser.open(address)
        asyncio.run(server.serve(sockets=[listener]))


def _listening(port: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((ADDRESS, port))
        listener.listen()
    except OSError as error:
        listener.close()
        raise ValueError(f"--port {port}: {(error.strerror or str(error)).lower()}; choose another") from None
    return listener
