"""What Handfast adds to viser's page: dark where the browser is, and room for the scene on a phone.

viser is dark where the page's address says `darkMode`, and otherwise light; on a narrow screen its panel takes six
tenths of the height, over the scene. Both are changed in the page's head, before viser's own code runs. What viser
names otherwise in another version stays as viser has it.
"""

from __future__ import annotations

from typing import Any

TITLE = b"<title>Viser</title>", b"<title>handfast view</title>"
HEAD_TAG = b"<head>"
DARK = """
const dark = matchMedia("(prefers-color-scheme: dark)"), address = new URL(location.href);
if (dark.matches !== address.searchParams.has("darkMode")) {
  if (dark.matches) address.searchParams.set("darkMode", ""); else address.searchParams.delete("darkMode");
  history.replaceState(null, "", address);
}
dark.addEventListener("change", () => location.reload());
"""
LIVE_CSS = """
:root { --soft: #667; --track: #e3e6ea; --mark: #222; --rim: #d5d9de; --known: #dfe8f4; --late: #ececec; }
@media (prefers-color-scheme: dark) {
  :root { --soft: #a5abb3; --track: #3d4249; --mark: #eee; --rim: #4a5058; --known: #263a54; --late: #333; }
}
@media (max-width: 36em) {
  .map { display: none; }
  [style*="max-height: 60%"], [style*="max-height: 60%"] [style*="width: 20em"] { width: 100% !important; }
  [style*="max-height: 60%"] { max-height: 44dvh !important; }
  html:not(:has([style*="max-height: 60%"] [style*="width: 20em"] > [style*="display: none"])) #root {
    height: 56dvh !important;
  }
}
"""
ADDED = f"<script>{DARK}</script><style>{LIVE_CSS}</style>".encode()


def dressed(process: Any) -> Any:
    """`process_request` of a server of the library websockets whose pages have what is added."""

    def process_request(connection: Any, request: Any) -> Any:
        if "Accept-Encoding" in request.headers:  # the page as it is, not compressed
            del request.headers["Accept-Encoding"]
        response = process(connection, request)
        if response is not None and HEAD_TAG in response.body[:2000]:
            response.body = response.body.replace(HEAD_TAG, HEAD_TAG + ADDED, 1).replace(*TITLE, 1)
            del response.headers["Content-Length"]
            response.headers["Content-Length"] = str(len(response.body))
        return response

    return process_request
