"""Meshcat beside other servers: on the next port where one is taken, a line where none is free."""

import socket
from contextlib import closing

import pytest
from pydrake.geometry import Meshcat

from drake_tc.errors import ParamsError
from drake_tc.loops import plant
from drake_tc.loops.plant import start_meshcat

PORTS = range(7000, 8000)


@pytest.fixture
def taken():
    """A port at which somebody listens: the first, unless somebody does so there already."""
    with closing(socket.socket()) as listener:
        try:
            listener.bind(("", PORTS[0]))
            listener.listen()
        except OSError:
            pass
        yield PORTS[0]


def test_where_a_port_is_taken_the_next_one_serves(taken):
    assert start_meshcat(quiet=True).port() in PORTS[1:]


def test_where_no_port_is_free_the_error_says_so(taken, monkeypatch):
    monkeypatch.setattr(plant, "Meshcat", lambda: Meshcat(taken))  # as if there were this one only
    with pytest.raises(ParamsError, match=r"Meshcat could not be started: .* a free port from 7000 to 7999") as caught:
        start_meshcat(quiet=True)
    assert "\n" not in str(caught.value)
