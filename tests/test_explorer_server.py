"""What a browser, another site's page, or a stranger's program can do to the explorer's server: work is counted."""

import asyncio
import http.client
import json
import logging
import re
import socket
import threading

import pytest

pytest.importorskip("bokeh", reason="no Bokeh: install the extra [web]")
QUERY = "m=1&c=0.01&k=1&f=1&w=2&r=0.8&g=0&x=w,1.8,2.2&y=m,0.9,1.1&index=std&n=200"
PULL = (json.dumps({"msgid": "1", "msgtype": "PULL-DOC-REQ"}), "{}", "{}")
PATCH = (json.dumps({"msgid": "2", "msgtype": "PATCH-DOC"}), "{}", json.dumps({"events": []}))


class Served:
    """A server in a thread of its own; it counts pages made, explorers that began, and explorers that ended."""

    def __init__(self, patch):
        from vibroimpact.explorer import page, server, session

        self.made, self.begun, self.ended = [], [], []
        for module, name, method, calls in (
            (page, "Page", "__init__", self.made),
            (session, "Explorer", "start", self.begun),
            (session, "Explorer", "close", self.ended),
        ):
            owner = getattr(module, name)
            before = getattr(owner, method)
            patch.setattr(owner, method, lambda one, *a, b=before, calls=calls: (calls.append(one), b(one, *a))[1])
        patch.setattr(server, "compute_point", lambda view: None)
        self.port, self._ready = 0, threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()))
        self._thread.start()
        assert self._ready.wait(60)

    async def _run(self):
        from vibroimpact.explorer import make_server

        self.loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        self.server, _ = make_server(port=0)
        self.port = self.server.port
        self._ready.set()
        await self._stop.wait()
        self.server.stop()
        await self.server._http.close_all_connections()
        self.server._tornado.tabs.close()

    def stop(self):
        self.loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(20)

    def get(self, path="/", **headers):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        connection.request("GET", path, headers={"Host": f"localhost:{self.port}", **headers})
        answer = connection.getresponse()
        text = answer.read().decode()
        connection.close()
        return answer, text

    def token(self):
        return re.search(r'"token":"([^"]+)"', self.get()[1]).group(1)

    async def enter(self, token=None, query=QUERY):
        """Return a websocket that has not heard yet whether it has joined."""
        from tornado.httpclient import HTTPRequest
        from tornado.websocket import websocket_connect

        place = f"localhost:{self.port}"
        token = token or await asyncio.to_thread(self.token)
        request = HTTPRequest(f"ws://{place}/ws?{query}", headers={"Origin": f"http://{place}"})
        return await websocket_connect(request, subprotocols=["bokeh", token], max_message_size=1 << 28)

    async def join(self, token=None, speak=PULL, query=QUERY):
        """Return a websocket that has joined, and the message that answers what it says."""
        tab = await self.enter(token, query)
        heard = await _message(tab)
        if heard is None:  # not let in
            return tab, heard
        assert heard["msgtype"] == "ACK"
        for part in speak:
            await tab.write_message(part)
        return tab, await _message(tab) if speak else None


async def _message(tab):
    """Return the header of the next message, with its content; None once the websocket is closed."""
    header = await asyncio.wait_for(tab.read_message(), 20)
    if header is None:
        tab.close()
        return None
    _, content = [await tab.read_message() for _ in range(2)]
    return {**json.loads(header), "content": content}


async def _leave(tab):
    tab.close()
    while await tab.read_message() is not None:
        pass


async def _until(condition):
    for _ in range(400):
        if condition():
            return
        await asyncio.sleep(0.05)
    raise AssertionError("it did not come about")


@pytest.fixture
def served(monkeypatch):
    one = Served(monkeypatch)
    yield one
    one.stop()


def test_requests_alone_make_no_page_and_begin_no_work(served):
    threads = threading.active_count()
    paths = ["/", f"/?{QUERY}", "/?" + "a" * 3000, "/autoload.js?bokeh-autoload-element=a", "/metadata", "/favicon.ico"]
    codes = {path: {served.get(path)[0].status for _ in range(30)} for path in paths}
    assert [codes[path] for path in paths] == [{200}] * 3 + [{404}] * 3
    assert served.get("/static/js/bokeh.min.js")[0].status == 200
    assert not served.made
    assert not served.begun
    assert not served.server.get_sessions()
    assert threading.active_count() == threads


def test_the_page_is_the_same_file_for_all_but_for_its_token_and_no_frame_of_another_site(served):
    (answer, one), (_, other) = served.get(), served.get(f"/?{QUERY}<script>")
    tokens = [re.search(r'"token":"([^"]+)"', text).group(1) for text in (one, other)]
    assert tokens[0] != tokens[1]
    assert one.replace(tokens[0], "") == other.replace(tokens[1], "")
    assert answer.headers["Content-Security-Policy"] == "frame-ancestors 'none'"
    assert answer.headers["Cache-Control"] == "no-store"


@pytest.mark.parametrize("host", ["evil.example", "evil.example:{port}", "localhost", "localhost:1", "",
                                  "localhost.evil.example:{port}", "localhost:{port}.evil.example"])  # fmt: skip
def test_a_host_that_is_not_this_machine_is_refused(served, host):
    for path in ("/", "/ws", "/static/js/bokeh.min.js"):
        answer, text = served.get(path, Host=host.format(port=served.port))
        assert answer.status in ((400, 421) if not host else (421,))
        assert "token" not in text
    assert served.get(Host=f"127.0.0.1:{served.port}")[0].status == 200
    assert served.get(Host=f"LOCALHOST:{served.port}")[0].status == 200


def test_work_begins_when_a_tab_speaks_and_ends_when_it_is_closed_without_a_word_in_the_log(served, caplog):
    async def visit():
        silent, _ = await served.join(speak=())
        assert not served.made
        tab, answer = await served.join()
        assert answer["msgtype"] == "PULL-DOC-REPLY"
        assert len(served.made) == 1
        await _until(lambda: served.begun)
        assert served.begun[0].view.osc.omega == 2.0
        await _leave(tab)
        await _leave(silent)
        await _until(lambda: served.begun[0].closed)
        assert served.begun[0].wait(120)  # the first time it compiles
        await _until(lambda: not served.server.get_sessions())

    with caplog.at_level(logging.WARNING):
        asyncio.run(visit())
    assert not [record for record in caplog.records if record.exc_info or "raceback" in record.getMessage()]


def test_tabs_that_are_dropped_while_they_compute_leave_nothing_and_no_traceback(served, caplog):
    async def visit():
        for _ in range(6):
            tab, _ = await served.join()
            await _leave(tab)
        await _until(lambda: len(served.begun) == 6 and all(one.closed for one in served.begun))
        await _until(lambda: not served.server.get_sessions())
        for one in served.made:  # a late result finds nobody
            one._receive([("message", "late")])

    with caplog.at_level(logging.WARNING):
        asyncio.run(visit())
    assert not [record for record in caplog.records if record.exc_info]


def test_beside_connections_that_never_speak_and_tabs_that_left_the_next_one_finds_room(served, monkeypatch):
    from vibroimpact.explorer import server

    monkeypatch.setattr(server, "MOST_PAGES", 2)

    async def visit():
        silent = [socket.create_connection(("127.0.0.1", served.port)) for _ in range(50)]
        joined = [(await served.join(speak=()))[0] for _ in range(20)]
        for _ in range(4):
            tab, answer = await served.join()
            assert answer["msgtype"] == "PULL-DOC-REPLY"
            await _leave(tab)
            await _until(lambda: all(one.closed for one in served.begun))
        for one in joined:
            await _leave(one)
        for one in silent:
            one.close()

    asyncio.run(visit())
    assert len(served.made) == 4


def test_a_connection_that_asks_for_nothing_is_closed(monkeypatch):
    from vibroimpact.explorer import server

    monkeypatch.setattr(server, "SILENT", 0.1)
    served = Served(monkeypatch)
    try:
        for said in (b"", b"GET / HTTP/1.1\r\nHost: local"):
            with socket.create_connection(("127.0.0.1", served.port), timeout=20) as silent:
                silent.sendall(said)
                assert silent.recv(1) == b""
    finally:
        served.stop()


def test_one_page_too_many_is_answered_and_makes_none(served, monkeypatch):
    from vibroimpact.explorer import server

    monkeypatch.setattr(server, "MOST_PAGES", 1)

    async def visit():
        first, _ = await served.join()
        second, answer = await served.join()
        assert answer["msgtype"] == "ERROR"
        assert "Close one" in answer["content"]
        assert await _message(second) is None
        await _leave(first)

    asyncio.run(visit())
    assert len(served.made) == 1


@pytest.mark.parametrize("first", [PULL, ()], ids=["speaks", "is silent"])
def test_a_token_opens_one_tab_and_a_second_one_hears_nothing_of_it(served, first):
    async def visit():
        token = await asyncio.to_thread(served.token)
        tab, _ = await served.join(token, speak=first)
        others = await asyncio.gather(*(served.join(token) for _ in range(20)))  # while the first page changes
        for other, answer in others:
            assert answer is None
            assert other.close_code == 1008
        (session,) = served.server.get_sessions()
        assert session.connection_count == 1
        await _leave(tab)

    asyncio.run(visit())
    assert len(served.made) == bool(first)


def test_of_many_tabs_that_join_at_once_with_one_token_one_is_let_in(served):
    async def visit():
        token = await asyncio.to_thread(served.token)
        tabs = await asyncio.gather(*(served.join(token) for _ in range(20)))
        ((tab, answer),) = [one for one in tabs if one[1]]
        assert answer["msgtype"] == "PULL-DOC-REPLY"
        await _leave(tab)

    asyncio.run(visit())
    assert len(served.made) == 1


def test_nothing_is_done_before_the_page_is_asked_for(served, monkeypatch, caplog):
    from vibroimpact.explorer.server import Socket

    async def visit():
        tab, answer = await served.join(speak=PATCH)
        assert answer is None
        assert tab.close_code == 1008
        monkeypatch.setattr(Socket, "open", lambda self: None)  # one that speaks before it has joined
        again = await served.enter()
        await again.write_message(PULL[0])  # it is closed at the first part
        assert await _message(again) is None
        assert again.close_code == 1008

    with caplog.at_level(logging.WARNING):
        asyncio.run(visit())
    assert not served.made
    assert not [record for record in caplog.records if record.exc_info]


def test_the_server_answers_others_while_a_page_is_made_and_forgets_who_left_meanwhile(served, monkeypatch):
    from vibroimpact.explorer import server

    begun, go_on, make = threading.Event(), threading.Event(), server.Page

    def slow(pool):
        begun.set()
        go_on.wait(20)
        return make(pool)

    monkeypatch.setattr(server, "Page", slow)

    async def visit():
        tab, _ = await served.join(speak=())
        for part in PULL:
            await tab.write_message(part)
        await asyncio.to_thread(begun.wait, 20)
        assert (await asyncio.to_thread(served.get))[0].status == 200
        tab.close()
        go_on.set()
        await _until(lambda: served.made and not served.server.get_sessions())

    try:
        asyncio.run(visit())
    finally:
        go_on.set()
    assert all(one.closed for one in served.begun)
    assert not served.server._tornado.tabs.open
