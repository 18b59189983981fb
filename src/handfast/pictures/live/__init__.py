"""A live page: a grasp whose load is turned and dragged with the mouse, and what Handfast proves about it at once.

`view_state` (what is set), `shown_state` (what is drawn), `answering` (what is asked) know nothing of the page and its
server; `page_server` alone knows viser.
"""
