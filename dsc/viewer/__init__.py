"""Shows runs in the browser: reads their records and serves a page (see PROTOCOL.md); needs the extra `viewer`."""
