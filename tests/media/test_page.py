"""The server of the page: what it serves, and what it refuses."""

import http.client
import json
import socket
import struct

import cv2
import numpy as np
import pytest

from jaxpf import InputError
from jaxpf.media.page.server import Conflict, Server


class Film:
    """Ten frames, each of one grey level."""

    name, path, opened = "<b>film</b>", "film", 0
    width, height, fps, num_frames = 24, 16, 25.0, 10

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
    server = Server(film, answers, note="so")
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
    about = json.loads(ask(server, f"/{server.token}/about")[1])
    assert (about["name"], about["frames"], about["note"]) == ("<b>film</b>", 10, "so")
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


def test_an_answer_may_let_the_page_choose(server):
    def conflict(content):
        raise Conflict("changed.", digest="a1")

    server.answers["conflict"] = conflict
    answer, content = post(server, "conflict", {})
    assert (answer.status, json.loads(content)) == (409, {"error": "changed.", "digest": "a1"})


def test_what_has_changed_is_told_anew(server):
    server.answers["about"] = lambda _: {"items": server.about["name"].upper()}
    about = json.loads(ask(server, f"/{server.token}/about")[1])
    assert (about["name"], about["items"]) == ("<b>film</b>", "<B>FILM</B>")


def test_the_server_of_a_closed_page_stays_while_a_run_goes_on(server, monkeypatch):
    monkeypatch.setattr("jaxpf.media.page.server._CLOSED", 0.0)
    asked = []
    server.wait(lambda: len(asked) < 3 and not asked.append(1))
    assert len(asked) == 3


@pytest.mark.parametrize(
    ("line", "status"),
    [
        ("GET foo", 400),
        ("GET a b", 400),
        ("BREW /{0}/about", 501),
        ("GET /{0}/frame/" + "9" * 5000, 400),
        ("GET /{0}/frame/" + "9" * 30, 404),
        ("POST /{0}/echo", 400),
        ("POST /{0}/echo [", 400),
        ("POST /{0}/echo " + "[" * 200_000, 400),
        ("POST /{0}/echo " + "9" * 5000, 400),
        ("POST /{0}/first {{}}", 400),
        ("POST /{0}/first []", 400),
        ("POST /{0}/first 3", 400),
        ("POST /{0}/disk 3", 400),
    ],
    ids=lambda text: f"{text}"[:30],
)
def test_a_bad_request_gets_a_status_and_no_traceback(server, capfd, line, status):
    def full(content):
        raise OSError("no space left")

    server.answers |= {"first": lambda content: content[0]["name"].upper(), "disk": full}
    first, _, body = line.format(server.token).partition(" ")[2].partition(" ")
    words = f"{line.split()[0]} {first}".strip()
    head = f"Host: 127.0.0.1:{server.port}\r\nContent-Type: application/json\r\n"
    request = f"{words} HTTP/1.1\r\n{head}Content-Length: {len(body)}\r\n\r\n{body}"
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as connection:
        connection.sendall(request.encode())
        assert connection.recv(100).split()[1] == f"{status}".encode()
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as connection:
        # A browser that leaves in the middle: the connection is reset.
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        connection.sendall(request.encode())
    assert post(server, "echo", 1)[0].status == 200
    assert capfd.readouterr().err == ""


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
