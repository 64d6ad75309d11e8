"""Stands between a client and one of our simulated lasers and writes down what passes, either way.

A line per read: seconds since the beginning, C>S or S>C, the bytes in hexadecimal: the form of the other traces.

hokuyolx takes whatever its reads return up to an empty line at a read's end for one message: two messages that wait together
are one to it, of which a sum is wrong. A sensor of 40 scans a second and a client that is never late hide that; on a busy
machine it must be told of each message alone. `unread` does: the next message goes out when the client has none.
"""

import os
import pty
import select
import socket
import termios
import threading
import time
import tty


def raw(descriptor):
    tty.setraw(descriptor, termios.TCSANOW)
    return descriptor


def write(to, taken):
    while taken:
        taken = taken[os.write(to, taken):]


class Relay:
    """One conversation; `address` is what the client is to open."""

    def __init__(self, server):
        self.lines = []
        self.begin = time.monotonic()
        self.over = threading.Event()
        self.listener = self.held = self.unread = None
        self.waiting = b""
        if server.startswith("/"):
            master, self.held = pty.openpty()
            raw(master), raw(self.held)
            self.address = os.ttyname(self.held)
            self.client, self.server = master, raw(os.open(server, os.O_RDWR | os.O_NOCTTY))
            self.thread = threading.Thread(target=self.pump)
        else:
            host, port = server.split(":")
            self.listener = socket.create_server(("127.0.0.1", 0))
            self.address = self.listener.getsockname()
            self.thread = threading.Thread(target=self.serve, args=((host, int(port)),))
        self.thread.start()

    def serve(self, address):
        """One client after another, each with a connection of its own."""
        while not self.over.is_set():
            if not select.select([self.listener], [], [], 0.1)[0]:
                continue
            client, _ = self.listener.accept()
            with client, socket.create_connection(address) as server:
                for end in (client, server):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self.client, self.server = client.fileno(), server.fileno()
                self.pump()

    def pump(self):
        ways = {self.client: (self.server, "C>S"), self.server: (self.client, "S>C")}
        while not self.over.is_set():
            for end in select.select(list(ways), [], [], 0.1)[0]:
                try:
                    taken = os.read(end, 65536)
                except OSError:
                    taken = b""
                if not taken:
                    return
                to, way = ways[end]
                self.lines.append((time.monotonic() - self.begin, way, taken))
                if self.unread and way == "S>C":
                    self.hand_over(to, taken)
                else:
                    write(to, taken)

    def hand_over(self, to, taken):
        *messages, self.waiting = (self.waiting + taken).split(b"\n\n")
        for message in messages:
            while self.unread() and not self.over.is_set():
                time.sleep(0.001)
            write(to, message + b"\n\n")

    def close(self):
        self.over.set()
        self.thread.join()

    def bytes(self, way):
        return b"".join(taken for _, direction, taken in self.lines if direction == way)

    def text(self):
        return "".join(f"{at:.6f} {way} {taken.hex()}\n" for at, way, taken in self.lines)
