"""Firefox as a person has it, driven by WebDriver BiDi over its own socket: no driver is needed."""

import base64
import json
import os
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from tests.recording.serving import ENOUGH

NAMES = ("firefox-esr", "firefox")
KEYS = {"Enter": "\ue007", "Escape": "\ue00c", "ArrowRight": "\ue014", "ArrowLeft": "\ue012"}
KEYS |= {"Tab": "\ue004", "Space": " "}
PREFERENCES = {  # no page of its own, nothing sent or fetched
    "app.normandy.enabled": False,
    "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "messaging-system.rsexperimentloader.enabled": False,
    "toolkit.telemetry.enabled": False,
}


class Firefox:
    """A Firefox without a window, and the one page that is open in it.

    Args:
        socket: Its BiDi session.
    """

    def __init__(self, socket: Any) -> None:
        self._socket, self._numbers = socket, count(1)
        self.messages: list[str] = []
        self.version = self.call("session.new", capabilities={})["capabilities"]["browserVersion"]
        (context,) = self.call("browsingContext.getTree")["contexts"]
        self._context = context["context"]
        self.call("session.subscribe", events=["log.entryAdded"])

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command; return its result."""
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._socket.recv(timeout=ENOUGH))
            if answer.get("method") == "log.entryAdded":
                self.messages.append(answer["params"]["text"])
            elif answer.get("id") == number:
                assert answer["type"] == "success", answer
                return answer["result"]

    def open(self, url: str, *, width: int = 1180, height: int = 800) -> None:
        """Open a page at a size, in CSS pixels."""
        size = {"width": width, "height": height}
        self.call("browsingContext.setViewport", context=self._context, viewport=size)
        self.call("browsingContext.navigate", context=self._context, url=url, wait="complete")

    def evaluate(self, expression: str) -> Any:
        """Return the value of an expression of JavaScript, as JSON has it."""
        result = self.call(
            "script.evaluate",
            expression=f"(async () => JSON.stringify(await ({expression})))()",
            target={"context": self._context},
            awaitPromise=True,
        )
        assert result["type"] == "success", result
        text = result["result"].get("value")
        return None if text is None else json.loads(text)

    def add(self, script: str) -> None:
        """Run a script in the page, whose policy lets none in by itself."""
        target = {"context": self._context}
        self.call("script.evaluate", expression=script, target=target, awaitPromise=False)

    def reload(self) -> "Firefox":
        """Load the page again."""
        self.call("browsingContext.reload", context=self._context, wait="complete")
        return self

    def until(self, expression: str) -> "Firefox":
        """Wait until an expression is true."""
        end = time.monotonic() + ENOUGH
        while not self.evaluate(f"Boolean({expression})"):
            assert time.monotonic() < end, (
                expression,
                self.evaluate("({...document.body.dataset})"),
            )
            time.sleep(0.02)
        return self

    def shows(self, **data: object) -> "Firefox":
        """Wait until the page is in a state, told by its ``data-`` attributes."""
        wanted = " && ".join(f"document.body.dataset.{k} === '{v}'" for k, v in data.items())
        return self.until(wanted)

    def down(self, key: str = "Space") -> "Firefox":
        return self._act({"type": "keyDown", "value": KEYS.get(key, key)})

    def up(self, key: str = "Space") -> "Firefox":
        return self._act({"type": "keyUp", "value": KEYS.get(key, key)})

    def tap(self, key: str) -> "Firefox":
        return self.down(key).up(key)

    def click(self, selector: str) -> "Firefox":
        """Press an element with the pointer, which has to be in sight."""
        place = self.evaluate(
            f"(() => {{ const e = document.querySelector({selector!r}); e.scrollIntoView("
            "{ block: 'center' }); const r = e.getBoundingClientRect();"
            "return { x: Math.round(r.x + r.width / 2), y: Math.round(r.y + r.height / 2) }; })()"
        )
        press = [{"type": "pointerMove", **place}, {"type": "pointerDown", "button": 0}]
        actions = [*press, {"type": "pointerUp", "button": 0}]
        return self._perform({"type": "pointer", "id": "mouse", "actions": actions})

    def picture(self, path: Path) -> "Firefox":
        """Write a picture of what is in sight."""
        data = self.call("browsingContext.captureScreenshot", context=self._context)["data"]
        path.write_bytes(base64.b64decode(data))
        return self

    def _act(self, action: dict[str, Any]) -> "Firefox":
        return self._perform({"type": "key", "id": "keyboard", "actions": [action]})

    def _perform(self, source: dict[str, Any]) -> "Firefox":
        self.call("input.performActions", context=self._context, actions=[source])
        return self


@contextmanager
def firefox() -> Iterator[Firefox]:
    """Start a Firefox of its own, or skip the test with the reason."""
    from websockets.sync.client import connect

    path = next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        pytest.skip("no Firefox is installed")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        lines = [f"user_pref({json.dumps(k)}, {json.dumps(v)});" for k, v in PREFERENCES.items()]
        (Path(profile) / "user.js").write_text("\n".join(lines))
        process = subprocess.Popen(
            [path, "--headless", "--no-remote", "--profile", profile, "--remote-debugging-port=0",
             "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
            env={**os.environ, "HOME": profile},
        )  # fmt: skip
        try:
            found = (re.search(r"BiDi listening on (ws://\S+)", line) for line in process.stderr)
            address = next(filter(None, found))[1]
            with connect(f"{address}/session", max_size=None, open_timeout=ENOUGH) as socket:
                yield Firefox(socket)
        finally:
            process.kill()
            process.communicate()
