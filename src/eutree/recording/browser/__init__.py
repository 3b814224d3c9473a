"""The recorder's page: one port of this machine serves the page and its socket."""

from eutree.recording.browser.server import PageServer, record_in_browser

__all__ = ["PageServer", "record_in_browser"]
