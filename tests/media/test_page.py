"""The server of the page: what it serves, and what it refuses."""

import http.client
import json

import cv2
import numpy as np
import pytest

from jaxpf import InputError
from jaxpf.media.page.server import Server


class Film:
    """Ten frames, each of one grey level."""

    path, opened = "film", 0

    def frames(self, start):
        self.opened += 1
        for level in range(start, 10):
            yield np.full((16, 24, 3), 20 * level, np.uint8)


def refuse(content):
    raise InputError("that is wrong.")


@pytest.fixture
def film():
    return Film()


@pytest.fixture
def server(film):
    answers = {"echo": lambda content: {"got": content}, "wrong": refuse}
    server = Server(film, {"name": "<b>film</b>"}, answers)
    yield server
    server.close()


def ask(server, path, method="GET", body=None, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    headers = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, path, body, headers)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer, content


def post(server, name, content, **headers):
    headers = {"Content_Type": "application/json"} | headers
    return ask(server, f"/{server.token}/{name}", "POST", json.dumps(content), **headers)


def level_of(server, number):
    answer, content = ask(server, f"/{server.token}/frame/{number}")
    assert answer.status == 200
    return cv2.imdecode(np.frombuffer(content, np.uint8), 1).mean()


def test_it_serves_the_page_and_frames(server, film):
    for name, start in (("", b"<!doctype html>"), ("page.js", b'"use strict"'), ("page.css", b":")):
        answer, content = ask(server, f"/{server.token}/{name}")
        assert answer.status == 200
        assert content.startswith(start)
    assert json.loads(ask(server, f"/{server.token}/about")[1]) == {"name": "<b>film</b>"}
    for number in (0, 1, 2, 7, 3):
        assert level_of(server, number) == pytest.approx(20 * number, abs=2)
    assert film.opened == 1, "frames passed over are kept"
    answer, content = ask(server, f"/{server.token}/frame/10")
    assert answer.status == 404
    assert b"has no frame 10" in content


def test_answers_and_refusals_are_json(server):
    assert json.loads(post(server, "echo", [1, "<b>"])[1]) == {"got": [1, "<b>"]}
    answer, content = post(server, "wrong", {})
    assert (answer.status, json.loads(content)) == (400, {"error": "that is wrong."})
    assert post(server, "none", {})[0].status == 404


@pytest.mark.parametrize("path", ["/", "/about", "/wrong-token/about", "/{0}", "/{0}x/about"])
def test_requests_without_the_token_are_refused(server, path):
    assert ask(server, path.format(server.token))[0].status == 403


def test_other_hosts_and_sites_are_refused(server):
    about = f"/{server.token}/about"
    assert ask(server, about, Host=f"localhost:{server.port}")[0].status == 200
    assert ask(server, about, Host="example.org")[0].status == 403
    assert ask(server, about, Host=f"example.org:{server.port}")[0].status == 403
    assert ask(server, about, Origin="http://example.org")[0].status == 403
    assert post(server, "echo", 1, Origin="null")[0].status == 403
    assert post(server, "echo", 1, Origin=f"http://127.0.0.1:{server.port}")[0].status == 200
    assert post(server, "echo", 1, Content_Type="text/plain")[0].status == 403


@pytest.mark.parametrize(
    "name", ["../server.py", "server.py", "frame/../../server.py", "frame/-1", "%2e%2e/x", "frame/"]
)
def test_no_path_reaches_the_file_system(server, name):
    assert ask(server, f"/{server.token}/{name}")[0].status == 404
