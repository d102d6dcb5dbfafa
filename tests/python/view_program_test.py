"""`view` as a process: which requests it answers, and a replay shows the observer's results."""

import contextlib
import csv
import json
import os
import re
import signal
import socket
import struct
import subprocess
import time
from pathlib import Path

from sprag import view
from support import SOURCE, FolderTest

SCENE = str(SOURCE / "scenes" / "lab_rig.toml")
PAGE = SOURCE / "python" / "sprag" / "view" / "page"
VIEW = os.environ["VIEW"]


class Connection(socket.socket):
    """A connection to a port of this host; every read ends after a while."""

    def __init__(self, port):
        super().__init__()
        self.settimeout(20.0)
        self.connect(("127.0.0.1", port))
        self.buffer = b""

    def until(self, end):
        while end not in self.buffer:
            more = self.recv(65536)
            if not more:
                break
            self.buffer += more
        at = self.buffer.find(end)
        return self.cut(at + len(end) if at >= 0 else len(self.buffer))

    def cut(self, n):
        while len(self.buffer) < n:
            more = self.recv(65536)
            if not more:
                break
            self.buffer += more
        part, self.buffer = self.buffer[:n], self.buffer[n:]
        return part

    def text(self):
        """The next text of a WebSocket, without pings; empty at the end of the connection."""
        while len(head := self.cut(2)) == 2:
            size = head[1] & 127
            if size >= 126:
                size = int.from_bytes(self.cut(2 if size == 126 else 8), "big")
            payload = self.cut(size)
            if head[0] & 15 == 1:
                return payload.decode()
        return ""

    def say(self, text):
        """A short text of a client, masked with zeros."""
        self.sendall(struct.pack("BBxxxx", 0x81, 0x80 | len(text)) + text.encode())


class ViewProgramTest(FolderTest):
    def refused(self, code, *arguments):
        """What the program says in this process before it ends with this exit code."""
        return self.run_main(view.main, SCENE, *arguments, code=code).stderr

    def serve(self, *more):
        """Starts `view` at a free port and waits until it serves."""
        command = [VIEW, SCENE, "--http", "127.0.0.1:0", "--report", self.folder / "report.json"]
        with open(self.folder / "said", "wb") as said:
            self.view = subprocess.Popen([*command, *(more or ("--url", "memq://"))], stderr=said)
        self.addCleanup(self.view.wait, 60)
        self.addCleanup(self.view.kill)
        end = time.monotonic() + 60
        while not (found := re.search(r"127.0.0.1:(\d+)/", (self.folder / "said").read_text())):
            self.assertLess(time.monotonic(), end, (self.folder / "said").read_text())
            time.sleep(0.02)
        self.port = int(found[1])
        self.host = f"127.0.0.1:{self.port}"

    def stop(self, number=signal.SIGTERM):
        self.view.send_signal(number)
        self.assertEqual(self.view.wait(30), 0, (self.folder / "said").read_text())
        return json.loads((self.folder / "report.json").read_text())

    def connection(self):
        connection = Connection(self.port)
        self.addCleanup(connection.close)
        return connection

    def get(self, target, more=""):
        return f"GET {target} HTTP/1.1\r\nHost: {self.host}\r\n{more}\r\n".encode()

    def upgrade(self, origin):
        more = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        more += f"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nOrigin: {origin}\r\n"
        return self.get("/stream", more)

    def ask(self, request):
        """Status, head and body of the response."""
        with Connection(self.port) as connection:
            connection.sendall(request)
            head = connection.until(b"\r\n\r\n").decode()
            length = re.search(r"Content-Length: (\d+)", head)
            body = b"" if request.startswith(b"HEAD") else connection.cut(int(length[1]))
            return int(head[9:12]), head, body

    def test_serves_only_the_page(self):
        self.serve()
        status, head, body = self.ask(self.get("/"))
        self.assertEqual(status, 200)
        self.assertIn("Content-Type: text/html; charset=utf-8", head)
        self.assertIn("Content-Security-Policy: default-src 'none'; script-src 'self';", head)
        self.assertIn("frame-ancestors 'none'", head)
        self.assertNotRegex(head, r"unsafe-eval|\*;|http:|https:|data:")
        self.assertIn("X-Content-Type-Options: nosniff", head)
        self.assertNotIn("Access-Control", head)
        self.assertEqual(body, (PAGE / "index.html").read_bytes())
        for file in ("/page.js", "/page.css", "/icon.svg", "/dygraph.js", "/dygraph.css"):
            self.assertIn(file.encode(), body)
            status, _, content = self.ask(self.get(file))
            self.assertEqual(status, 200, file)
            self.assertGreater(len(content), 100, file)
        host = f"Host: {self.host}\r\n"
        for request, status in (
            (f"HEAD / HTTP/1.1\r\n{host}\r\n", 200),
            (f"GET / HTTP/1.1\r\n{host}{host}\r\n", 400),
            ("nonsense\r\n\r\n", 400),
        ):
            self.assertEqual(self.ask(request.encode())[0], status, request)
        # More of these rules is in view_test.
        self.assertEqual(self.ask(self.upgrade("http://evil.example"))[0], 403)
        report = self.stop()
        self.assertEqual(report["clients"], 0)
        self.assertEqual(report["requests_refused"], 1)

    def test_a_replay_shows_the_estimates_of_the_observer(self):
        events, states = self.folder / "events.csv", self.folder / "states.csv"
        for command in (
            [*f"MASTER_SIM {SCENE} --duration 3 --speed max --no-lcm --events".split(), events],
            ["OBSERVER", SCENE, "--replay", events, "--states", states],
        ):
            command[0] = os.environ[command[0]]
            subprocess.run(command, check=True, capture_output=True)
        self.serve("--replay", str(events), "--speed", "max")
        dead, alive = self.connection(), self.connection()  # the first one never reads
        dead.sendall(self.upgrade(f"http://{self.host}"))
        alive.sendall(self.upgrade(f"http://{self.host}"))
        self.assertTrue(alive.until(b"\r\n\r\n").startswith(b"HTTP/1.1 101"))
        received, over = 0, False
        while not over or received < 40:
            message = json.loads(alive.text())
            received += 1
            self.assertEqual(message["n"], received)
            over, shown = message["over"], message["frame"]["settled"]
            alive.say(f'{{"seen": {received}}}')
        with open(states, newline="") as file:
            last = list(csv.DictReader(file))[-1]
        self.assertGreater(int(last["k"]), 1000)
        self.assertEqual(shown["tick"], int(last["k"]))
        for name in ("q", "u"):
            self.assertEqual(shown[name], [float(last[f"{name}{i}"]) for i in (1, 2)])
        report = self.stop()
        self.assertEqual(report["clients"], 2)
        self.assertTrue(report["observed_here"])
        self.assertLessEqual(report["frames"]["sent"], received + 3 + 3, "only acknowledged ones")

    def test_clients_that_never_read_or_send_rubbish_do_not_block_others(self):
        self.serve()
        # Some do not even send a request.
        for i in range(32):
            dead = self.connection()
            if i % 4 != 0:
                dead.sendall(self.upgrade(f"http://{self.host}"))
        # A message that is too long, and one without a mask and with an invalid length.
        for rubbish in (
            struct.pack(">BBQxxxx", 0x81, 0xFF, 10_000_000) + 10_000_000 * b"x",
            struct.pack(">BBQ", 0x81, 127, 2**64 - 1),
        ):
            stream = self.connection()
            stream.sendall(self.upgrade(f"http://{self.host}"))
            with contextlib.suppress(OSError):
                stream.sendall(rubbish)
                while stream.recv(65536):
                    pass
        alive = self.connection()
        alive.sendall(self.upgrade(f"http://{self.host}"))
        self.assertTrue(alive.until(b"\r\n\r\n").startswith(b"HTTP/1.1 101"))
        # It stays connected while more of the others arrive.
        for n in range(1, 101):
            self.assertTrue(alive.text(), f"closed at frame {n}")
            alive.say(f'{{"seen": {n}}}')
            if n % 20 == 0:
                self.connection()
        self.assertEqual(self.ask(self.get("/"))[0], 200)
        self.assertGreaterEqual(self.stop()["displaced"], 2)

    def test_clients_that_acknowledge_and_do_not_read_cost_no_memory(self):
        events = self.folder / "events.csv"
        events.write_text("t,contact,closed\n0.4,1,1\n0.4,1,0\n100,1,1\n100,1,0\n")
        self.serve("--replay", events, "--speed", "8")
        reader, *slow = (self.connection() for _ in range(9))
        for stream in slow:
            stream.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        for stream in (reader, *slow):
            stream.sendall(self.upgrade(f"http://{self.host}"))
        self.assertTrue(reader.until(b"\r\n\r\n").startswith(b"HTTP/1.1 101"))

        def resident():
            status = Path(f"/proc/{self.view.pid}/status").read_text()
            return int(re.search(r"VmRSS:\s+(\d+)", status)[1])

        before = None
        for n in range(1, 81):
            self.assertTrue(reader.text(), f"closed at frame {n}")
            for stream in (reader, *slow):
                stream.say(f'{{"seen": {10**9}, "view": {{"window": 20, "pixels": 4000}}}}')
            if n == 30:
                before = resident()
        self.assertLess(resident() - before, 50_000)
        self.stop()

    def test_a_port_of_the_bus_that_is_in_use_is_reported(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
            taken.bind(("", 0))
            port = taken.getsockname()[1]
            url = f"udpm://239.255.76.67:{port}?ttl=0"
            said = self.refused(1, "--http", "127.0.0.1:0", "--url", url)
        self.assertIn(f"UDP port {port} is in use", said)
        self.assertNotIn("ip route", said)

    def test_errors_of_the_server_are_reported(self):
        self.serve()
        said = self.refused(1, "--url", "memq://", "--http", self.host)
        self.assertIn(f"{self.host}: Address already in use; another program listens there", said)
        for http in ("nonsense", "nohost:8080"):
            self.assertIn("--http: ", self.refused(2, "--url", "memq://", "--http", http))
        for arguments in (
            ["--replay", str(self.folder / "nothing")],
            ["--speed", "2"],
            ["--url", "udpm://1.2.3.4:1"],
        ):
            self.refused(2, *arguments)
        self.stop(signal.SIGHUP)
        self.serve("--url", "memq://", "--http", self.host)  # the port is free again
        self.stop()
