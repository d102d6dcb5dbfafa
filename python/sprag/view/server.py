"""Serves the page's files and its stream over HTTP, to this page only and for reading only.

At most 32 connections are open. While all are taken, a new connection displaces the one that has
made no progress for the longest time, at least a second: a client that does not read cannot block
the server.
"""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import json
import math
import os
import socket
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aiohttp import WSMsgType, web

from .._command import UsageError, finite_number
from .history import Window
from .watch import Watch

RATE = 60.0  # frames per second
PLACES = 32
STALLED = 1.0  # s without progress
LOOKS, BETWEEN_LOOKS = 40, 0.05  # s, for a stalled connection
FIRST_REQUEST = 10.0  # s
HEARTBEAT = 13.0  # s; a client that does not answer is closed after one and a half
LONGEST_MESSAGE = 4096  # bytes, of a client
MOST_UNSEEN = 3  # messages that the page has not acknowledged
CURVES_PERIOD, HEALTH_PERIOD = 0.045, 0.5  # s
MOST_PIXELS = 4000

SAFETY_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
FILES = {
    "/": ("index.html", "text/html"),
    "/index.html": ("index.html", "text/html"),
    "/page.css": ("page.css", "text/css"),
    "/page.js": ("page.js", "text/javascript"),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
    "/dygraph.css": ("dygraph.css", "text/css"),
    "/dygraph.js": ("dygraph.js", "text/javascript"),
}


def endpoint_of(text: str) -> tuple[str, int]:
    """ADDRESS:PORT or PORT. Raises UsageError."""
    address, _, port = text.rpartition(":")
    bracketed = address.startswith("[") and address.endswith("]")
    known = port.isascii() and port.isdigit() and int(port) <= 65535
    if not known or bracketed != (":" in address):
        raise UsageError(f"--http: {text} is not allowed; must be ADDRESS:PORT or PORT")
    address = address.strip("[]")
    address = "127.0.0.1" if address in ("", "localhost") else address
    try:
        ipaddress.ip_address(address)
    except ValueError:
        reason = f"{address} is no address of this host, as 127.0.0.1 is"
        raise UsageError(f"--http: {reason}") from None
    return address, int(port)


def text_of(address: str, port: int) -> str:
    return f"[{address}]:{port}" if ":" in address else f"{address}:{port}"


def is_loopback(address: str) -> bool:
    return ipaddress.ip_address(address).is_loopback


def _bound_socket(address: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    try:
        return socket.create_server((address, port), family=family, backlog=128)
    except OSError as error:
        remedy = ""
        if error.errno == errno.EADDRINUSE:
            remedy = "; another program listens there, --http takes another port (0: any free one)"
        reason = os.strerror(error.errno or 0)
        raise OSError(f"{text_of(address, port)}: {reason}{remedy}") from None


def refusal(request: web.BaseRequest, here: tuple[str, int]) -> tuple[int, str] | None:
    """Status and reason of a request that is not answered."""
    address, port = here
    names = [address, "localhost"] if is_loopback(address) else [address]
    hosts = {text_of(name, port) for name in names} | ({*names} if port == 80 else set())
    host: list[str] = request.headers.getall("Host", [])
    if len(host) != 1 or host[0] not in hosts:
        return 403, "this host is not served here"
    if request.method not in ("GET", "HEAD"):
        return 405, "only GET and HEAD: nothing can be changed here"
    if request._message.path == "/stream":
        if request.method != "GET" or request.headers.get("Upgrade", "").lower() != "websocket":
            return 426, "this is a WebSocket"
        if request.headers.getall("Origin", []) != [f"http://{host[0]}"]:
            return 403, "the stream is for the page that is served here"
    elif request._message.path not in FILES:
        return 404, "there is no such file"
    return None


@dataclass
class Counts:
    requests: int = 0
    requests_refused: int = 0  # requests answered with an error
    displaced: int = 0  # connections without progress, closed for new ones
    turned_away: int = 0  # connections above the limit
    clients: int = 0  # of the stream
    sent: int = 0  # frames
    dropped: int = 0  # not sent: the client was not ready
    bytes: int = 0  # of frames


@dataclass
class View:
    """What a page shows."""

    follow: bool = True
    length: float = 20.0  # of the following window [s]
    start: float = 0.0
    end: float = 1.0
    pixels: int = 800
    quantity: str = ""

    def window(self, extent: tuple[float, float]) -> Window:
        if not self.follow:
            return Window(self.start, self.end, self.pixels)
        end = max(extent[1], extent[0] + self.length)  # fills from the left before it moves
        return Window(end - self.length, end, self.pixels)


@dataclass
class Client:
    """One page: its view, and which messages it has. Every message has the newest data."""

    sent: int = 0
    seen: int = 0
    view: View = field(default_factory=View)
    changed: bool = True
    curves_sent: float = -math.inf
    health_sent: float = -math.inf
    end: float = math.inf  # of the extent when curves were sent last
    session: int | None = None

    def wants(self) -> bool:
        return self.sent - self.seen < MOST_UNSEEN

    def receive(self, text: str) -> None:
        """{"seen": n} or {"view": {...}}; anything else has no effect."""
        try:
            said = json.loads(text)
        except (ValueError, RecursionError):
            return
        if not isinstance(said, dict):
            return
        seen = finite_number(said.get("seen"))
        if seen is not None and 0.0 <= seen < 1e15:
            self.seen = max(self.seen, min(int(seen), self.sent))
        given = said.get("view")
        if not isinstance(given, dict):
            return
        start, end, length, pixels = (
            finite_number(given.get(name)) for name in ("from", "to", "window", "pixels")
        )
        view = self.view
        if start is not None and end is not None and start < end:
            view.follow, view.start, view.end = False, start, end
        elif length is not None and length > 0.0:
            view.follow, view.length = True, length
        if pixels is not None and pixels >= 1.0:
            view.pixels = int(min(pixels, MOST_PIXELS))
        if isinstance(given.get("quantity"), str):
            view.quantity = given["quantity"]
        self.changed = True

    def next(self, watch: Watch, stage: Stage, cache: dict[Any, str]) -> str:
        """The next message. `cache` has the parts that the clients share at this instant."""
        wall = time.monotonic()
        self.sent += 1

        def shared(key: Any, make: Any, *arguments: Any) -> str:
            if key not in cache:
                cache[key] = make(*arguments)
            return cache[key]

        parts = [f'"n":{self.sent},"over":{json.dumps(stage.over)}']
        if self.sent == 1:
            parts.append(f'"scene":{shared("scene", watch.description, stage.speed)}')
        parts.append(f'"frame":{shared("frame", watch.frame, stage.now)}')
        extent, view = watch.extent(), self.view
        self.changed |= self.session != watch.session
        moved = wall - self.curves_sent >= CURVES_PERIOD and extent[1] != self.end
        if self.changed or (moved and (view.follow or self.end <= view.end)):
            window = view.window(extent)
            key = (view.quantity, window)
            parts.append(f'"curves":{shared(key, watch.curves, view.quantity, window)}')
            self.curves_sent, self.end = wall, extent[1]
            self.changed, self.session = False, watch.session
        if wall - self.health_sent >= HEALTH_PERIOD:
            parts.append(f'"health":{shared("health", watch.health_text, stage.now)}')
            self.health_sent = wall
        return "{" + ",".join(parts) + "}"


@dataclass
class Stage:
    """The time of the watch's messages [s], and of a replay its speed and whether it has ended."""

    now: float = 0.0
    speed: float | None = None
    over: bool = False


class Connection(web.RequestHandler):
    """A connection with a place, or one that waits for a place."""

    def __init__(self, server: Server, manager: web.Server, **options: Any) -> None:
        super().__init__(manager, **options)
        self.server = server
        self.progress = time.monotonic()  # of the last completed write or request
        self.requested = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        loop = asyncio.get_running_loop()
        loop.call_later(FIRST_REQUEST, lambda: None if self.requested else self.abort())
        if len(self.server.connections) < PLACES:
            self.server.connections.add(self)
        else:
            assert isinstance(transport, asyncio.Transport)
            transport.pause_reading()
            self.admission = loop.create_task(self._wait_for_place(transport))

    async def _wait_for_place(self, transport: asyncio.Transport) -> None:
        places = self.server.connections
        for _ in range(LOOKS):
            slowest = min(places, key=lambda connection: connection.progress, default=None)
            if slowest and len(places) >= PLACES and time.monotonic() - slowest.progress > STALLED:
                self.server.counts.displaced += 1
                places.discard(slowest)
                slowest.abort()
            if transport.is_closing():
                return
            if len(places) < PLACES:
                places.add(self)
                transport.resume_reading()
                return
            await asyncio.sleep(BETWEEN_LOOKS)
        self.server.counts.turned_away += 1
        self.abort()

    def abort(self) -> None:
        if isinstance(self.transport, asyncio.Transport):
            self.transport.abort()

    def connection_lost(self, exc: BaseException | None) -> None:
        self.server.connections.discard(self)
        super().connection_lost(exc)


class Server:
    def __init__(self, watch: Watch, stage: Stage, http: str) -> None:
        self.watch, self.stage = watch, stage
        self.counts = Counts()
        self.connections: set[Connection] = set()
        self.clients: dict[web.WebSocketResponse, tuple[Client, Connection]] = {}
        self.sending: dict[web.WebSocketResponse, asyncio.Task[None]] = {}
        folder = Path(__file__).with_name("page")
        self.files = {path: (folder / name).read_bytes() for path, (name, _) in FILES.items()}
        self.socket = _bound_socket(*endpoint_of(http))
        self.address, self.port = self.socket.getsockname()[:2]

    async def start(self) -> None:
        loop = asyncio.get_running_loop()
        options: dict[str, Any] = {"keepalive_timeout": 10.0, "access_log": None}
        manager = web.Server(self._answer)
        await loop.create_server(
            lambda: Connection(self, manager, loop=loop, **options), sock=self.socket
        )

    async def _answer(self, request: web.BaseRequest) -> web.StreamResponse:
        connection = request.protocol
        assert isinstance(connection, Connection)
        connection.progress, connection.requested = time.monotonic(), True
        self.counts.requests += 1
        transport = request.transport
        here = transport.get_extra_info("sockname") if transport else None
        if refused := refusal(request, (here or (self.address, self.port))[:2]):
            self.counts.requests_refused += 1
            status, why = refused
            more = {405: {"Allow": "GET, HEAD"}, 426: {"Upgrade": "websocket"}}.get(status, {})
            return web.Response(status=status, text=f"{why}\n", headers=SAFETY_HEADERS | more)
        path = request._message.path
        if path == "/stream":
            return await self._stream(request, connection)
        kind = FILES[path][1]
        charset = "utf-8" if kind.startswith("text/") else None
        body = self.files[path]
        return web.Response(body=body, content_type=kind, charset=charset, headers=SAFETY_HEADERS)

    async def _stream(self, request: web.BaseRequest, connection: Connection) -> web.StreamResponse:
        stream = web.WebSocketResponse(
            heartbeat=HEARTBEAT, max_msg_size=LONGEST_MESSAGE, compress=False
        )
        stream.headers.update(SAFETY_HEADERS)
        await stream.prepare(request)
        client = Client()
        self.counts.clients += 1
        self.clients[stream] = client, connection
        try:
            async for message in stream:
                if message.type == WSMsgType.TEXT:
                    client.receive(message.data)
        finally:
            del self.clients[stream]
        return stream

    def send(self) -> None:
        """Sends every client that is ready its next message."""
        cache: dict[Any, str] = {}
        for stream, (client, connection) in self.clients.items():
            transport = connection.transport
            if not isinstance(transport, asyncio.Transport):
                continue
            waits = stream in self.sending or transport.get_write_buffer_size() > 0
            if waits or stream.closed or not client.wants():
                self.counts.dropped += 1
                continue
            text = client.next(self.watch, self.stage, cache)
            self.sending[stream] = asyncio.create_task(self._send(stream, connection, text))

    async def _send(self, stream: web.WebSocketResponse, connection: Connection, text: str) -> None:
        try:
            await stream.send_str(text)
            connection.progress = time.monotonic()
            self.counts.sent += 1
            self.counts.bytes += len(text)
        except (ConnectionError, RuntimeError):
            connection.abort()
        finally:
            del self.sending[stream]
