"""Serves the page on this machine alone.

The address holds a secret token; requests without it, for another host or from another site are
refused.  Only the page's own files, frames of the opened source and what ``Content`` offers are
served: no path of a request reaches the file system.
"""

import http.server
import json
import secrets
import threading
import time
from collections.abc import Callable, Mapping
from importlib import resources
from typing import Any

from jaxpf.contract.errors import InputError
from jaxpf.media.overlay import NUM_COLOURS, object_colours
from jaxpf.media.page.pictures import Pictures

#: The page's own files and their kinds.
_FILES = {
    "": ("page.html", "text/html"),
    "page.js": ("page.js", "text/javascript"),
    "page.css": ("page.css", "text/css"),
}
#: Seconds between signs of life, and after which the server of a closed page ends.
_BEAT, _CLOSED = 1.0, 60.0
#: Largest body of a request, bytes.
_MOST = 8 * 2**20
_POLICY = (
    "default-src 'self'; img-src 'self' data:; "
    "frame-ancestors 'self' http://127.0.0.1:* http://localhost:*"
)


class Refusal(Exception):
    """What an answer raises to refuse a request, with a status and content that the page knows."""

    def __init__(self, status: int, **content: Any):
        super().__init__(status)
        self.status, self.content = status, content


class _Http(http.server.ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, *_: Any) -> None:
        """A browser that drops a connection is no error."""


class Server:
    """The page's server, which runs in threads of its own from construction to ``close``.

    Attributes:
        url: address of the page, with its token.
    """

    def __init__(
        self,
        source: Any,
        about: Mapping[str, object],
        answers: Mapping[str, Callable[[Any], Any]],
    ):
        """Start to serve.

        Args:
            source: the film, from ``jaxpf.media.open_frames`` or like it.
            about: what the page needs to know at once, as JSON.
            answers: name -> function of a request's JSON that returns JSON.  An ``InputError`` is
                shown on the page.  The answer of "about" replaces what has changed since.
        """
        self.pictures, self.about, self.answers = Pictures(source), dict(about), answers
        self.token = secrets.token_urlsafe(16)
        self.open_pages: set[int] = set()
        self.last_seen = time.monotonic()
        self._http = _Http(("127.0.0.1", 0), _handler(self))
        self.port = self._http.server_address[1]
        self.url = f"http://127.0.0.1:{self.port}/{self.token}/"
        self.is_closed = False
        # It looks for the end every twentieth of a second, not every half: `close` waits for it.
        threading.Thread(target=self._http.serve_forever, args=(0.05,), daemon=True).start()

    def wait(self, stays: Callable[[], bool]) -> None:
        """Return a minute after the page was closed, but not while ``stays()``."""
        while self.open_pages or time.monotonic() - self.last_seen < _CLOSED or stays():
            time.sleep(_BEAT / 4)

    def close(self) -> None:
        """Stop to serve."""
        self.is_closed = True
        self._http.shutdown()
        self._http.server_close()
        self.pictures.close()


def described(source: Any, **more: Any) -> dict[str, Any]:
    """What the page knows of a film at once; ``more`` adds to it or replaces it."""
    about = {
        "name": source.name,
        "width": source.width,
        "height": source.height,
        "fps": source.fps,
        "frames": source.num_frames or source.count_frames(),
        "kind": "boxes",
        "items": [],
        "digests": {},
        "note": "",
        "start": 0,
        "results": [],
        "colours": [f"#{bytes(rgb).hex()}" for rgb in object_colours(NUM_COLOURS)],
        "can_draw": True,
        "can_track": False,
    }
    return about | more


def _handler(server: Server) -> type[http.server.BaseHTTPRequestHandler]:
    class Handler(http.server.BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def log_message(self, *_: Any) -> None:
            """Requests are not logged."""

        def do_GET(self) -> None:
            self._answer(self._got)

        def do_POST(self) -> None:
            self._answer(self._posted)

        def _answer(self, act: Callable[[], None]) -> None:
            """Answer a request; whatever is wrong with it becomes a status and a sentence."""
            try:
                act()
            except Refusal as refusal:
                self._send_json(refusal.status, refusal.content)
            except InputError as error:
                self._send_json(400, {"error": str(error)})
            except Exception as error:
                self.close_connection = True
                self._send_json(400, {"error": f"the request is malformed ({error!r:.99})."})

        def _got(self) -> None:
            name = self._name()
            if name is None:
                return self._send(403, b"refused", "text/plain")
            if name in _FILES:
                file, kind = _FILES[name]
                folder = resources.files("jaxpf.media.page")
                return self._send(200, (folder / file).read_bytes(), f"{kind}; charset=utf-8")
            if name == "about":
                now = server.answers["about"](None) if "about" in server.answers else {}
                return self._send_json(200, server.about | now)
            if name == "alive":
                return self._stay_alive()
            if name.startswith("frame/") and name[6:].isascii() and name[6:].isdigit():
                return self._send_frame(int(name[6:]))
            return self._send(404, b"not found", "text/plain")

        def _posted(self) -> None:
            name, length = self._name(), self.headers.get("Content-Length", "")
            is_json = self.headers.get_content_type() == "application/json"
            if name is None or not is_json or not length.isdigit() or int(length) > _MOST:
                self.close_connection = True
                return self._send(403, b"refused", "text/plain")
            body = self.rfile.read(int(length))
            if name not in server.answers:
                return self._send(404, b"not found", "text/plain")
            return self._send_json(200, server.answers[name](json.loads(body)))

        def _name(self) -> str | None:
            """What is asked for; None for a request that is refused."""
            hosts = {f"127.0.0.1:{server.port}", f"localhost:{server.port}"}
            origin = self.headers.get("Origin")
            if self.headers.get("Host") not in hosts:
                return None
            if origin is not None and origin.removeprefix("http://") not in hosts:
                return None
            _, token, *rest = self.path.split("/", 2)
            is_ours = secrets.compare_digest(token.encode(), server.token.encode())
            return rest[0].partition("?")[0] if is_ours and rest else None

        def _send_frame(self, number: int) -> None:
            try:
                picture = server.pictures.jpeg(number)
            except InputError as error:
                return self._send(404, str(error).encode(), "text/plain; charset=utf-8")
            return self._send(200, picture, "image/jpeg", "private, max-age=3600")

        def _send_json(self, status: int, content: object) -> None:
            self._send(status, json.dumps(content).encode(), "application/json")

        def _send(self, status: int, body: bytes, kind: str, keep: str = "no-store") -> None:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Cache-Control", keep)
            self.send_header("Content-Security-Policy", _POLICY)
            self.send_header("X-Content-Type-Options", "nosniff")
            self.end_headers()
            self.wfile.write(body)

        def _stay_alive(self) -> None:
            """An endless answer, which breaks when the page is closed."""
            self.send_response(200)
            self.send_header("Content-Type", "text/event-stream")
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            self.close_connection = True
            server.open_pages.add(id(self))
            try:
                while not server.is_closed:
                    self.wfile.write(b": alive\n\n")
                    self.wfile.flush()
                    time.sleep(_BEAT)
            except OSError:
                pass
            finally:
                server.open_pages.discard(id(self))
                server.last_seen = time.monotonic()

    return Handler
