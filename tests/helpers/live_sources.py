"""A web server and cameras for tests."""

import contextlib
import functools
import http.server
import threading
import time

import cv2


@contextlib.contextmanager
def served(folder):
    """The files of a folder at an address of this machine."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *arguments):
            pass

    handler = functools.partial(Quiet, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()


def put_camera(monkeypatch, picture, pause=0.0):
    """Camera 0 of this machine gives ``picture(number)`` every ``pause`` seconds, until None."""

    class Camera:
        def __init__(self, address):
            self.is_there, self.number = address == 0, -1

        def isOpened(self):
            return self.is_there

        def get(self, name):
            return 30.0 if name == cv2.CAP_PROP_FPS else -1.0

        def read(self):
            self.number += 1
            time.sleep(pause)
            frame = picture(self.number)
            return (False, None) if frame is None else (True, frame[..., ::-1])

        def release(self):
            pass

    monkeypatch.setattr(cv2, "VideoCapture", Camera)
