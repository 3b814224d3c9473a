"""Any message and any host at all is decoded, known or refused.

No server runs beside these tests: its thread draws from the process's random generator, and
Hypothesis then takes its own examples for unrepeatable.
"""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.errors import InvalidArgumentError
from eutree.recording.browser.wire import Gate, RateLimit, decode, is_loopback


@pytest.mark.promise(24)
@given(st.one_of(st.text(max_size=300), st.binary(max_size=300)))
def test_any_message_is_decoded_or_refused(message) -> None:
    try:
        decode(message)
    except InvalidArgumentError:
        return


fields = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=2),
    max_leaves=4,
)


@pytest.mark.promise(24)
@settings(max_examples=300)
@given(
    st.sampled_from(["hello", "key", "drawn", "gone", "do", "take"]),
    st.dictionaries(
        st.sampled_from(["client", "sequence", "key", "down", "frame", "name", "value"]), fields
    ),
)
def test_nearly_right_messages_are_decoded_or_refused(kind, rest) -> None:
    try:
        decode(json.dumps({"type": kind, **rest}))
    except InvalidArgumentError:
        return


@given(st.text(max_size=40))
def test_no_host_but_our_own_is_known(host) -> None:
    if Gate("t").knows(host):
        assert host.lower().rsplit(":", 1)[0].rstrip(":") in (
            "127.0.0.1",
            "localhost",
            "[::1]",
        ) or (host.lower() in ("127.0.0.1", "localhost", "[::1]"))


def test_a_server_for_the_network_knows_its_addresses_but_no_names() -> None:
    gate = Gate("t", "0.0.0.0")
    assert gate.knows("192.168.1.7:8765")
    assert gate.knows("[fe80::1]:8765")
    assert not gate.knows("evil.example:8765")
    assert Gate("t", "recorder.lan").knows("recorder.lan:8765")
    assert [is_loopback(h) for h in ("127.0.0.1", "localhost", "::1", "0.0.0.0", "10.0.0.1")] == [
        True, True, True, False, False,
    ]  # fmt: skip


def test_the_limit_lets_a_steady_rate_through() -> None:
    limit = RateLimit(rate=100.0, burst=10.0)
    assert all(limit.admits(k / 99) for k in range(1000))
    assert not all(limit.admits(20.0 + k / 200) for k in range(100))


def test_the_token_is_compared_in_constant_time(monkeypatch) -> None:
    """A control: the comparison is the library's, not ``==``."""
    seen = []
    monkeypatch.setattr(
        "eutree.recording.browser.wire.hmac.compare_digest", lambda a, b: seen.append((a, b))
    )
    Gate("secret").refusal("/socket", ["localhost"], ["http://localhost"], ["token.guess"])
    assert seen == [(b"guess", b"secret")]
