"""Serves the page on this machine alone.

The address holds a secret token; requests without it, for another host or from another site are
refused.  Only the page's own files, frames of the opened source and the given answers are served:
no path of a request reaches the file system.
"""

import http.server
import json
import secrets
import threading
import time
from collections.abc import Callable, Mapping
from importlib import resources
from typing import Any

import cv2

from jaxpf.contract.errors import InputError
from jaxpf.media.overlay import NUM_COLOURS, object_colours

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
#: Number of pictures kept, and of frames decoded before one that is asked for out of order.
_KEPT, _BEFORE = 400, 40
#: Frames that are decoded and passed over rather than opening the source again.
_NEAR = 250
_POLICY = (
    "default-src 'self'; img-src 'self' data:; "
    "frame-ancestors 'self' http://127.0.0.1:* http://localhost:*"
)


class Conflict(Exception):
    """What an answer raises if the page must choose; ``content`` is what it needs for that.

    Args:
        error: the sentence that the page shows.
        status: 400 if the page has nothing to choose, but what it knows has changed.
        content: what the page needs to go on.
    """

    def __init__(self, error: str, status: int = 409, **content: Any):
        super().__init__(error)
        self.status, self.content = status, {"error": error, **content}


class Server(http.server.ThreadingHTTPServer):
    """The page's server, which runs in threads of its own from construction to ``close``.

    Attributes:
        url: address of the page, with its token.
    """

    daemon_threads = True

    def __init__(self, source: Any, answers: Mapping[str, Callable[[Any], Any]], **about: Any):
        """Start to serve.

        Args:
            source: the film, from ``jaxpf.media.open_frames`` or like it.
            answers: name -> function of a request's JSON that returns JSON.  An ``InputError`` is
                shown on the page.  The answer of "about" replaces what has changed since.
            about: what the page needs to know at once besides the film, as JSON.
        """
        super().__init__(("127.0.0.1", 0), _Handler)
        self.pictures, self.answers = _Pictures(source), answers
        self.about = {
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
            **about,
        }
        self.token = secrets.token_urlsafe(16)
        self.open_pages: set[int] = set()
        self.last_seen = time.monotonic()
        self.port = self.server_address[1]
        self.url = f"http://127.0.0.1:{self.port}/{self.token}/"
        self.is_closed = False
        # It looks for the end every twentieth of a second, not every half: `close` waits for it.
        threading.Thread(target=self.serve_forever, args=(0.05,), daemon=True).start()

    def handle_error(self, *_: Any) -> None:
        """A browser that drops a connection is no error."""

    def wait(self, stays: Callable[[], bool]) -> None:
        """Return a minute after the page was closed, but not while ``stays()``."""
        while self.open_pages or time.monotonic() - self.last_seen < _CLOSED or stays():
            time.sleep(_BEAT / 4)

    def close(self) -> None:
        """Stop to serve."""
        self.is_closed = True
        self.shutdown()
        self.server_close()
        self.pictures.close()


class _Pictures:
    """Pictures of a source's frames, decoded on demand; recent ones are kept.

    Videos are decoded in order, because seeking lands on the wrong frame in many of them.
    """

    def __init__(self, source: Any):
        self._source = source
        self._kept: dict[int, bytes] = {}
        self._reader: Any = None
        self._next = 0
        self._lock = threading.Lock()

    def jpeg(self, number: int) -> bytes:
        """The frame ``number``, from 0, as JPEG.

        Raises:
            InputError: there is no such frame.
        """
        with self._lock:
            if number not in self._kept:
                self._decode_to(number)
            picture = self._kept[number] = self._kept.pop(number)  # the latest that was used
            return picture

    def _decode_to(self, number: int) -> None:
        if self._reader is None or not self._next <= number <= self._next + _NEAR:
            self.close()
            self._next = max(number - _BEFORE, 0) if number < self._next else number
            self._reader = self._source.frames(self._next)
        while self._next <= number:
            frame = next(self._reader, None)
            if frame is None:
                self._reader = None
                raise InputError(f"'{self._source.path}' has no frame {number}.")
            self._kept[self._next] = cv2.imencode(".jpg", frame[..., ::-1])[1].tobytes()
            self._next += 1
            if len(self._kept) > _KEPT:
                del self._kept[next(iter(self._kept))]

    def close(self) -> None:
        """Release the source."""
        if self._reader is not None:
            self._reader.close()
            self._reader = None


class _Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Server

    def log_message(self, *_: Any) -> None:
        """Requests are not logged."""

    def do_GET(self) -> None:
        self._answer(self._get)

    def do_POST(self) -> None:
        self._answer(self._post)

    def _answer(self, act: Callable[[], None]) -> None:
        """Answer a request; whatever is wrong with it becomes a status and a sentence."""
        try:
            act()
        except Conflict as conflict:
            self._send_json(conflict.status, conflict.content)
        except InputError as error:
            self._send_json(400, {"error": str(error)})
        except Exception as error:
            self.close_connection = True
            self._send_json(400, {"error": f"the request is malformed ({error!r:.99})."})

    def _get(self) -> None:
        name, server = self._name(), self.server
        if name is None:
            return self._send(403, b"refused", "text/plain")
        if name in _FILES:
            file, kind = _FILES[name]
            content = (resources.files("jaxpf.media.page") / file).read_bytes()
            return self._send(200, content, f"{kind}; charset=utf-8")
        if name == "about":
            now = server.answers["about"](None) if "about" in server.answers else {}
            return self._send_json(200, server.about | now)
        if name == "alive":
            return self._stay_alive()
        if name.startswith("frame/") and name[6:].isascii() and name[6:].isdigit():
            return self._send_frame(int(name[6:]))
        return self._send(404, b"not found", "text/plain")

    def _post(self) -> None:
        name, length = self._name(), self.headers.get("Content-Length", "")
        is_json = self.headers.get_content_type() == "application/json"
        if name is None or not is_json or not length.isdigit() or int(length) > _MOST:
            self.close_connection = True
            return self._send(403, b"refused", "text/plain")
        body = self.rfile.read(int(length))
        if name not in self.server.answers:
            return self._send(404, b"not found", "text/plain")
        return self._send_json(200, self.server.answers[name](json.loads(body)))

    def _name(self) -> str | None:
        """What is asked for; None for a request that is refused."""
        hosts = {f"127.0.0.1:{self.server.port}", f"localhost:{self.server.port}"}
        origin = self.headers.get("Origin")
        if self.headers.get("Host") not in hosts:
            return None
        if origin is not None and origin.removeprefix("http://") not in hosts:
            return None
        _, token, *rest = self.path.split("/", 2)
        is_ours = secrets.compare_digest(token.encode(), self.server.token.encode())
        return rest[0].partition("?")[0] if is_ours and rest else None

    def _send_frame(self, number: int) -> None:
        try:
            picture = self.server.pictures.jpeg(number)
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
        server = self.server
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
