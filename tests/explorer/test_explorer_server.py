"""What a browser, another site's page, or a stranger's program can do to the explorer's server: work is counted."""

import asyncio
import http.client
import json
import logging
import socket
import threading

import numpy as np
import pytest

pytest.importorskip("tornado", reason="needs the extra [web]")
QUERY = "m=1&c=0.01&k=1&f=1&w=2&r=0.8&g=0&x=w,1.8,2.2&y=m,0.9,1.1&index=std&n=200"


class Served:
    """A server in a thread of its own; it counts pages made, explorers that began, and explorers that ended."""

    def __init__(self, patch):
        from vibroimpact.explorer import page, server, session

        self.made, self.begun = [], []
        for owner, method, calls in ((page.Page, "__init__", self.made), (session.Explorer, "start", self.begun)):
            before = getattr(owner, method)
            patch.setattr(owner, method, lambda one, *a, b=before, calls=calls: (calls.append(one), b(one, *a))[1])
        patch.setattr(server, "compute_point", lambda view: None)
        self.port, self._ready = 0, threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()))
        self._thread.start()
        assert self._ready.wait(300)

    async def _run(self):
        from vibroimpact.explorer import make_server

        self.loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        self.server, _ = make_server(port=0)
        self.port = self.server.port
        self._ready.set()
        await self._stop.wait()
        await self.server.stop()

    def stop(self):
        self.loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(20)

    def get(self, path="/", **headers):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=300)
        connection.request("GET", path, headers={"Host": f"localhost:{self.port}", **headers})
        answer = connection.getresponse()
        text = answer.read().decode()
        connection.close()
        return answer, text

    async def enter(self, query=QUERY, origin="http://localhost:{}"):
        """Return the websocket of a tab, of a page of some origin."""
        from tornado.httpclient import HTTPRequest
        from tornado.websocket import websocket_connect

        place = f"localhost:{self.port}"
        request = HTTPRequest(f"ws://{place}/ws?{query}", headers={"Origin": origin.format(self.port)})
        return await websocket_connect(request, max_message_size=1 << 28)


async def _parts(tab):
    """Return the parts of the next message, as the page's script reads them; None once the websocket is closed."""
    message = await asyncio.wait_for(tab.read_message(), 20)
    if message is None:
        tab.close()
        return None
    begin = 4 + int.from_bytes(message[:4], "little")
    assert begin % 8 == 0

    def numbers(content):
        if "array" not in content:
            return content
        kind, place, size = content["array"]
        return np.frombuffer(message, kind, size, begin + place)

    return dict(json.loads(message[4:begin], object_hook=numbers, parse_constant=pytest.fail))


async def _heard(tab, *kinds):
    """Return the parts of messages until all that are waited for have come."""
    parts = {}
    while not parts.keys() >= {*kinds}:
        parts |= await _parts(tab)
    return parts


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
    paths = ["/", f"/?{QUERY}", "/?" + "a" * 3000, "/static/page.js", "/ws/", "/favicon.ico"]
    codes = {path: {served.get(path)[0].status for _ in range(30)} for path in paths}
    assert [codes[path] for path in paths] == [{200}] * 3 + [{404}] * 3
    assert served.get("/ws")[0].status == 400  # no websocket
    assert not served.made
    assert not served.server.tabs.open
    assert threading.active_count() <= threads  # others may have ended


def test_the_page_is_the_same_file_for_all_and_in_no_frame_of_another_site(served):
    (answer, one), (_, other) = served.get(), served.get(f"/?{QUERY}<script>")
    assert one == other
    assert "{{" not in one
    assert "{%" not in one
    assert answer.headers["Content-Security-Policy"] == "frame-ancestors 'none'"
    assert answer.headers["Cache-Control"] == "no-store"


@pytest.mark.parametrize("host", ["evil.example", "evil.example:{port}", "localhost", "localhost:1", "",
                                  "localhost.evil.example:{port}", "localhost:{port}.evil.example"])  # fmt: skip
def test_a_host_that_is_not_this_machine_is_refused(served, host):
    for path in ("/", "/ws", "/page.js"):
        answer, text = served.get(path, Host=host.format(port=served.port))
        assert answer.status in ((400, 421) if not host else (421,))
        assert "explorer is reached" in text or answer.status == 400
    assert served.get(Host=f"127.0.0.1:{served.port}")[0].status == 200
    assert served.get(Host=f"LOCALHOST:{served.port}")[0].status == 200


def test_other_pages_may_not_open_the_websocket(served):
    from tornado.httpclient import HTTPClientError

    with pytest.raises(HTTPClientError) as refused:
        asyncio.run(served.enter(origin="http://evil.example"))
    assert refused.value.code == 403
    assert not served.made


def test_the_server_listens_on_loopback_alone():
    from vibroimpact.explorer import check_host, is_loopback, origins

    assert is_loopback(check_host("localhost"))
    assert origins("127.0.0.1", 5006) == ["127.0.0.1:5006", "localhost:5006"]


def test_a_host_that_lets_others_in_is_warned_of(capsys):
    from vibroimpact.explorer import check_host

    assert check_host("0.0.0.0") == "0.0.0.0"
    assert "anyone" in capsys.readouterr().err
    with pytest.raises(ValueError, match="`host`"):
        check_host("no such machine")


def test_a_port_that_is_taken_is_refused_in_words(served):
    from vibroimpact.explorer import make_server

    for port in (served.port, 70_000, -1):
        with pytest.raises(ValueError, match="`port`"):
            make_server(port=port)


def test_work_begins_when_a_tab_enters_and_ends_when_it_is_closed_without_a_word_in_the_log(served, caplog):
    async def visit():
        tab = await served.enter()
        assert (await _heard(tab, "marks"))["marks"]["x"] == 2.0
        assert len(served.made) == 1
        await tab.write_message("type omega 2.1 1")
        await _until(lambda: served.begun[0].view.osc.omega == 2.1)
        await tab.write_message(b"type omega 2.2 2", binary=True)  # the page's script sends text
        await _leave(tab)
        await _until(lambda: served.begun[0].closed)
        assert served.begun[0].wait(300)  # the first time it compiles
        assert served.begun[0].view.osc.omega == 2.1
        await _until(lambda: not served.server.tabs.open)

    with caplog.at_level(logging.WARNING):
        asyncio.run(visit())
    assert not [record for record in caplog.records if record.exc_info or "raceback" in record.getMessage()]


def test_numbers_reach_the_browser_as_they_are_and_what_is_none_as_null(served):
    from vibroimpact.explorer.server import packed

    arrays = {name: np.arange(7, dtype=name) for name in ("float64", "float32", "uint16", "uint8")}
    message = packed({"a": {**arrays, "x": (np.float64(0.1), np.nan, -np.inf), "empty": np.empty(0)}, "ü": {"b": True}})

    class Heard:
        async def read_message(self):
            return message

    parts = asyncio.run(_parts(Heard()))
    for name, array in arrays.items():
        assert parts["a"][name].dtype == array.dtype
        assert (parts["a"][name] == array).all()
    assert parts["a"]["x"] == [0.1, None, None]
    assert parts["a"]["empty"].size == 0
    assert parts["ü"] == {"b": True}


def test_tabs_that_are_dropped_while_they_compute_leave_nothing_and_no_traceback(served, caplog):
    async def visit():
        for _ in range(6):
            await _leave(await served.enter())
        await _until(lambda: len(served.begun) == 6 and all(one.closed for one in served.begun))
        await _until(lambda: not served.server.tabs.open)
        for one in served.made:  # a late result finds nobody
            one.receive([("message", "late")])

    with caplog.at_level(logging.WARNING):
        asyncio.run(visit())
    assert not [record for record in caplog.records if record.exc_info]


def test_a_browser_that_does_not_listen_gets_the_latest_of_each_kind(served):
    from vibroimpact.explorer.page import Page
    from vibroimpact.explorer.state import View

    told, listens = [], asyncio.Event()

    async def tell(parts):
        await listens.wait()
        told.append(parts)

    async def visit():
        loop = asyncio.get_running_loop()
        page = Page(
            served.server.tabs._pool,
            tell,
            lambda job: loop.call_soon_threadsafe(lambda: loop.create_task(job())),
            View(),
        )
        for number in range(5):
            page.receive([("rest", None), ("message", f"word {number}")])
            await asyncio.sleep(0)
        listens.set()
        await _until(lambda: len(told) >= 7)
        page.explorer.close()

    asyncio.run(visit())
    assert [parts["message"]["text"] for parts in told if "message" in parts] == [f"word {k}" for k in range(5)]
    assert sum("busy" in parts for parts in told) == 2  # the first, and the last of those that waited


def test_beside_connections_that_never_speak_and_tabs_that_left_the_next_one_finds_room(served, monkeypatch):
    from vibroimpact.explorer import server

    monkeypatch.setattr(server, "MOST_PAGES", 2)

    async def visit():
        silent = [socket.create_connection(("127.0.0.1", served.port)) for _ in range(50)]
        for _ in range(4):
            tab = await served.enter()
            assert "message" not in await _parts(tab)
            await _leave(tab)
            await _until(lambda: all(one.closed for one in served.begun))
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
            with socket.create_connection(("127.0.0.1", served.port), timeout=300) as silent:
                silent.sendall(said)
                assert silent.recv(1) == b""
    finally:
        served.stop()


def test_one_page_too_many_is_answered_and_makes_none(served, monkeypatch):
    from vibroimpact.explorer import server

    monkeypatch.setattr(server, "MOST_PAGES", 1)

    async def visit():
        first = await served.enter()
        second = await served.enter()
        answer = await _parts(second)
        assert "Close one" in answer["message"]["text"]
        assert await _parts(second) is None
        assert second.close_code == 1013
        await _leave(first)

    asyncio.run(visit())
    assert len(served.made) == 1


def test_an_address_that_cannot_be_read_is_answered_and_the_default_shown(served):
    async def visit():
        tab = await served.enter("m=heavy")
        assert "This link cannot be shown" in (await _heard(tab, "message", "marks"))["message"]["text"]
        await _leave(tab)

    asyncio.run(visit())


def test_a_page_whose_picture_fails_goes_on_with_the_next(served, monkeypatch, caplog):
    async def visit():
        tab = await served.enter()
        await _until(lambda: served.begun)
        (page,) = served.made
        monkeypatch.setitem(page._show, "rest", lambda _: 1 / 0)
        page.receive([("rest", None)])
        await _until(lambda: caplog.records)
        page.receive([("message", "still here")])
        await _heard(tab, "message")
        await _leave(tab)

    asyncio.run(visit())
    assert any("ZeroDivisionError" in (record.exc_text or str(record.exc_info)) for record in caplog.records)
